// SPDX-License-Identifier: Apache-2.0
// Cancellation points for long work.
#pragma once

#include <stop_token>

#include "algo/base/errors.hpp"

namespace plumb {

[[noreturn]] void ThrowStopped();

/// @throws Interrupted on a stop request.
inline void CheckStop(const std::stop_token& stop) {
  if (stop.stop_requested()) ThrowStopped();
}

}  // namespace plumb
