// A change that a service of the store refuses.
#pragma once

#include <stdexcept>
#include <string>

#include "web/model/change.hpp"

namespace plumb {

/// A refused change and its reason; the message is for the person who requested it.
class StoreRefusal : public std::runtime_error {
 public:
  StoreRefusal(ChangeResult result, const std::string& message)
      : std::runtime_error(message), result_(result) {}
  [[nodiscard]] ChangeResult result() const { return result_; }

 private:
  ChangeResult result_;
};

}  // namespace plumb
