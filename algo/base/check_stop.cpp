// SPDX-License-Identifier: Apache-2.0
#include "algo/base/check_stop.hpp"

#include "words/progress.hpp"

namespace plumb {

void ThrowStopped() { throw Interrupted(say::progress::Stopped()); }

}  // namespace plumb
