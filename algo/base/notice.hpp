// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace plumb {

/// The notice on every picture, page and report. It is never cut and cannot be dismissed.
inline constexpr std::string_view kResearchNotice =
    "Research use only. Not a medical device. Do not use to position patients for treatment or to "
    "replace image guidance.";

}  // namespace plumb
