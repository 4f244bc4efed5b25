#pragma once

#include <string_view>

namespace plumb {

/// Version of this build, as `plumb --version` prints it.
[[nodiscard]] std::string_view Version();

/// The notice that every picture, page and report carries.
inline constexpr std::string_view kResearchNotice =
    "Research use only. Not a medical device. Do not use to position patients for treatment or to replace image guidance.";

}  // namespace plumb
