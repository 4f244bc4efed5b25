// SPDX-License-Identifier: Apache-2.0
// Calls that come back to an object which may be destroyed in the meantime.
#pragma once

#include <memory>
#include <utility>

namespace plumb {

/// A member of the object that is called back. The object is destroyed on the thread on which the
/// calls run, mostly the loop's.
class AliveFlag {
 public:
  AliveFlag() = default;
  ~AliveFlag() { *alive_ = false; }
  AliveFlag(const AliveFlag&) = delete;
  AliveFlag& operator=(const AliveFlag&) = delete;

  /// `call`, which does nothing once this object is destroyed. It may be passed through any thread.
  template <typename Call>
  [[nodiscard]] auto WhileAlive(Call call) const {
    return [alive = alive_, call = std::move(call)](const auto&... arguments) {
      if (*alive) call(arguments...);
    };
  }

 private:
  const std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace plumb
