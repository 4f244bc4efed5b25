// A change that a service of the store does not make.
#pragma once

#include <stdexcept>
#include <string>

#include "web/service/change.hpp"

namespace plumb {

/// A change that is not made, and why; the message is for the person who asked.
class StoreRefusal : public std::runtime_error {
 public:
  StoreRefusal(web::ChangeResult result, const std::string& message)
      : std::runtime_error(message), result_(result) {}
  [[nodiscard]] web::ChangeResult result() const { return result_; }

 private:
  web::ChangeResult result_;
};

}  // namespace plumb
