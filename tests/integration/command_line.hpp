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

/// Names of the suite's scenes in order: the reference first.
[[nodiscard]] const std::vector<std::string>& SmallNames();

/// The recordings of ../shared/data, or an empty path where they are not there.
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
