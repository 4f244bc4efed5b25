// Cancellation points for long work.
#pragma once

#include <stop_token>

#include "algo/base/errors.hpp"

namespace plumb {

/// @throws Interrupted on a stop request.
inline void CheckStop(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Interrupted("stopped on request");
}

}  // namespace plumb
