// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace plumb {

/// Version of this build, as `plumb --version` prints it.
[[nodiscard]] std::string_view Version();

}  // namespace plumb
