// SPDX-License-Identifier: Apache-2.0
// What a sanitizer changes for tests of whole programs: everything takes several times as long, so
// they wait longer, and figures of time and memory say nothing of the product. The work itself is
// the same.
#pragma once

#include <string>

#include <gtest/gtest.h>

namespace plumb::testing {

#if defined(__SANITIZE_THREAD__)
inline constexpr int kSlowness = 10;
#elif defined(__SANITIZE_ADDRESS__)
inline constexpr int kSlowness = 4;
#else
inline constexpr int kSlowness = 1;
#endif
inline constexpr bool kIsSanitized = kSlowness > 1;

/// A figure of time or memory that must stay below a limit. Under a sanitizer it is printed, but
/// not compared with the limit.
inline void ExpectBelow(const std::string& what, double figure, double limit) {
  if (!kIsSanitized) {
    EXPECT_LT(figure, limit) << what;
  } else {
    std::printf(
        "%s: %.0f, not compared with its limit of %.0f: a sanitizer itself takes time and "
        "memory\n",
        what.c_str(), figure, limit);
  }
}

}  // namespace plumb::testing
