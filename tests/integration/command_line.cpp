// SPDX-License-Identifier: Apache-2.0
#include "tests/integration/command_line.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

namespace plumb {
namespace {

/// Only one process makes the shared data; the others wait for it.
class DataLock {
 public:
  DataLock() {
    fs::create_directories(PLUMB_INTEGRATION_DATA);
    fd_ = open((fs::path(PLUMB_INTEGRATION_DATA) / "lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC,
               0644);
    flock(fd_, LOCK_EX);
  }
  ~DataLock() { close(fd_); }
  DataLock(const DataLock&) = delete;
  DataLock& operator=(const DataLock&) = delete;

 private:
  int fd_ = -1;
};

void MakeOnce(const fs::path& target, const std::vector<std::string>& arguments) {
  const DataLock lock;
  if (fs::exists(target)) return;
  const RunResult result = Plumb(arguments);
  if (result.exit_code != 0)
    throw std::runtime_error("cannot make " + target.string() + ": " + result.err);
}

}  // namespace

std::vector<std::string> PlumbCommand(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), PLUMB_BINARY);
  return arguments;
}

RunResult Plumb(std::vector<std::string> arguments, const ProcessOptions& options) {
  return Run(PlumbCommand(std::move(arguments)), options);
}

const fs::path& SmallSuite() {
  static const fs::path suite = [] {
    const fs::path target = fs::path(PLUMB_INTEGRATION_DATA) / "suite";
    // 3 Hz over 10 s: as slow as a real sweep, with a tenth of its frames.
    MakeOnce(target, {"simulate", "--suite", "demo", "--frames", "30", "--rate", "3", "--size",
                      "320x240", "--seed", "5", "--out", target});
    return target;
  }();
  return suite;
}

const fs::path& SmallLiveSuite() {
  static const fs::path suite = [] {
    const fs::path target = fs::path(PLUMB_INTEGRATION_DATA) / "live-suite";
    MakeOnce(target, {"simulate", "--suite", "live", "--live", "live_steps", "live_two_left",
                      "live_two_right", "--live-seconds", "20", "--frames", "60", "--rate", "8",
                      "--size", "320x240", "--seed", "5", "--out", target});
    return target;
  }();
  return suite;
}

fs::path SmallLiveScene() {
  const fs::path target = fs::path(PLUMB_INTEGRATION_DATA) / "live-scene";
  const fs::path recording = SmallLiveSuite() / "recordings" / "moved";
  MakeOnce(target, {"reconstruct", recording, "--out", target});
  return target;
}

const fs::path& SmallCtSuite() {
  static const fs::path suite = [] {
    const fs::path target = fs::path(PLUMB_INTEGRATION_DATA) / "ct-suite";
    MakeOnce(target, {"simulate", "--suite", "ct", "--frames", "50", "--rate", "5", "--size",
                      "320x240", "--seed", "5", "--unit", "5", "--out", target});
    return target;
  }();
  return suite;
}

const std::vector<std::string>& SmallNames() {
  static const auto names = nlohmann::json::parse(ReadText(SmallSuite() / "suite.json"))
                                .at("scenes")
                                .get<std::vector<std::string>>();
  return names;
}

fs::path SmallRecording(const std::string& name) { return SmallSuite() / "recordings" / name; }

fs::path SmallScene(const std::string& name) {
  const fs::path target = fs::path(PLUMB_INTEGRATION_DATA) / ("scene-" + name);
  const fs::path recording = SmallRecording(name);
  MakeOnce(target, {"reconstruct", recording, "--out", target});
  return target;
}

fs::path SharedData(const std::string& name) {
  const char* const set = std::getenv("PLUMB_TEST_DATA");
  const fs::path data =
      set != nullptr ? fs::path(set) : fs::path(PLUMB_SOURCE_DIR) / ".." / "shared" / "data";
  if (set == nullptr && !fs::is_directory(data)) return {};
  if (!fs::is_directory(data / name))
    throw std::runtime_error("no folder " + name + " in " + data.string());
  return fs::canonical(data / name);
}

std::string ReadText(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return {std::istreambuf_iterator<char>(in), {}};
}

void WriteText(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
}

void CommandLineTest::SetUp() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string("plumb_") + test->test_suite_name() + "_" + test->name();
  std::replace(name.begin(), name.end(), '/', '_');
  folder_ = fs::path(::testing::TempDir()) / name;
  fs::remove_all(folder_);
  fs::create_directories(folder_);
}

void CommandLineTest::TearDown() { fs::remove_all(folder_); }

fs::path CommandLineTest::Copy(const fs::path& folder, const std::string& name) {
  const fs::path copy = folder_ / name;
  fs::copy(folder, copy, fs::copy_options::recursive);
  for (const auto& entry : fs::recursive_directory_iterator(copy))
    fs::permissions(entry, fs::perms::owner_write, fs::perm_options::add);
  return copy;
}

std::vector<std::string> CommandLineTest::LeftBehind(const std::vector<std::string>& known) const {
  std::vector<std::string> left;
  for (const auto& entry : fs::directory_iterator(folder_)) {
    const std::string name = entry.path().filename().string();
    if (std::find(known.begin(), known.end(), name) == known.end()) left.push_back(name);
  }
  return left;
}

}  // namespace plumb
