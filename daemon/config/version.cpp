// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/version.hpp"

namespace plumb {

std::string_view Version() { return PLUMB_VERSION; }

}  // namespace plumb
