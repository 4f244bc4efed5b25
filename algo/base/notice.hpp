#pragma once

#include <string_view>

namespace plumb {

/// The notice that every picture, page and report carries; never cut, never dismissed.
inline constexpr std::string_view kResearchNotice =
    "Research use only. Not a medical device. Do not use to position patients for treatment or to "
    "replace image guidance.";

}  // namespace plumb
