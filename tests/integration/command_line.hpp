// SPDX-License-Identifier: Apache-2.0
// What all tests of the real binary share: running it, and small simulated recordings made once.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/process.hpp"

namespace plumb {

namespace fs = std::filesystem;

/// Runs `plumb ARGUMENTS`.
[[nodiscard]] RunResult Plumb(std::vector<std::string> arguments,
                              const ProcessOptions& options = {});
[[nodiscard]] std::vector<std::string> PlumbCommand(std::vector<std::string> arguments);

/// A small demo suite (30 frames of 320 x 240 a scene), simulated by the binary itself the first
/// time a test asks.
[[nodiscard]] const fs::path& SmallSuite();
/// One of its recordings, "reference" or "current", and the scene reconstructed from it.
[[nodiscard]] fs::path SmallRecording(const std::string& name);
[[nodiscard]] fs::path SmallScene(const std::string& name);

/// A small suite of a sensor at rest: two sweeps, and 20 s in which the body breathes and, after
/// 13 s, is moved by 2 mm, after 17 s by 3 mm across.
[[nodiscard]] const fs::path& SmallLiveSuite();
/// The scene of the body that it is over.
[[nodiscard]] fs::path SmallLiveScene();

/// A small suite of planning CTs in four positions and ten placements, each pair of them.
[[nodiscard]] const fs::path& SmallCtSuite();

/// Names of the suite's scenes in order: the reference first.
[[nodiscard]] const std::vector<std::string>& SmallNames();

/// A folder of the recordings that are not in the repository (tests/README.md): in PLUMB_TEST_DATA,
/// by default ../shared/data beside the checkout. Empty where neither is there. Where one is, a
/// folder that is missing in it is a test that must not be left out.
/// @throws std::runtime_error
[[nodiscard]] fs::path SharedData(const std::string& name);

[[nodiscard]] std::string ReadText(const fs::path& file);
void WriteText(const fs::path& file, const std::string& text);

/// An empty folder of the test's own, removed after it.
class CommandLineTest : public testing::Test {
 protected:
  void SetUp() override;
  void TearDown() override;
  /// A writable copy of a recording or scene.
  fs::path Copy(const fs::path& folder, const std::string& name);
  /// Everything in the test's folder but the named entries, hidden ones too: what a failed command
  /// left behind.
  [[nodiscard]] std::vector<std::string> LeftBehind(const std::vector<std::string>& known) const;

  fs::path folder_;
};

}  // namespace plumb

/// Defines `folder` as SharedData(name), in the body of a test; leaves the test out without the
/// data.
#define PLUMB_SHARED_DATA(folder, name)                           \
  const std::filesystem::path folder = ::plumb::SharedData(name); \
  if (folder.empty())                                             \
  GTEST_SKIP() << "the test data in \"" << (name)                 \
               << "\" are missing; PLUMB_TEST_DATA names their folder"
