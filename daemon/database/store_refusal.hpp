// SPDX-License-Identifier: Apache-2.0
// A change that a service of the store refuses.
#pragma once

#include <utility>

#include "algo/base/errors.hpp"
#include "web/model/change.hpp"

namespace plumb {

/// A refused change and its reason; the message is for the person who requested it.
class StoreRefusal : public MessageError {
 public:
  StoreRefusal(ChangeResult result, Message message)
      : MessageError(std::move(message)), result_(result) {}
  [[nodiscard]] ChangeResult result() const { return result_; }

 private:
  ChangeResult result_;
};

}  // namespace plumb
