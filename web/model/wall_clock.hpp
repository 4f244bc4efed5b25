// SPDX-License-Identifier: Apache-2.0
// The clock of everything that people read.
#pragma once

#include <chrono>

namespace plumb {

using WallClock = std::chrono::system_clock;

}  // namespace plumb
