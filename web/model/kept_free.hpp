// SPDX-License-Identifier: Apache-2.0
// The one reserve of disk space beside what is uploaded, copied or fetched.
#pragma once

#include <cstdint>

namespace plumb {

/// For scans meanwhile: five of 640x480. A unit that keeps recordings may need more for one.
inline constexpr std::uint64_t kKeptFree = std::uint64_t{256} << 20;

}  // namespace plumb
