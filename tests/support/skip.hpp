// SPDX-License-Identifier: Apache-2.0
// Leaving out a test that this machine cannot run.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string_view>

namespace plumb::testing {

/// True where a test that is left out counts as failed: continuous integration has everything.
[[nodiscard]] inline bool RequiresAllTests() {
  const char* value = std::getenv("PLUMB_REQUIRE_ALL");
  return value != nullptr && std::string_view(value) != "0" && *value != '\0';
}

}  // namespace plumb::testing

/// For a tool that toolchain/install brings and for the rights of root, in a function that returns
/// nothing: fails where PLUMB_REQUIRE_ALL=1. What no installation can bring uses GTEST_SKIP():
/// mounts and loop devices that the machine does not permit, and recordings that are not part of
/// the repository. toolchain/test lists these at its end.
#define PLUMB_SKIP(reason)                                                 \
  do {                                                                     \
    if (::plumb::testing::RequiresAllTests())                              \
      FAIL() << "left out, though PLUMB_REQUIRE_ALL is set: " << (reason); \
    GTEST_SKIP() << (reason);                                              \
  } while (false)
