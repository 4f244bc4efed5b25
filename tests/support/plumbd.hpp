// SPDX-License-Identifier: Apache-2.0
// A real plumbd with the virtual sensor, as its own process, and what a person at the control
// socket does with it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <sys/types.h>
#include <nlohmann/json.hpp>

#include "tests/support/http_client.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/model/settings.hpp"

namespace plumb::testing {

struct PlumbdOptions {
  std::filesystem::path program = {};       ///< Empty: plumbd as it is installed.
  std::vector<std::string> arguments = {};  ///< Beside those that every test needs.
  std::map<std::string, std::string> environment = {};
  int sweep_frames = 120;
  int scenes = 1;  ///< Of the demo: 2 where `next-scene` shows the moved body. Each takes its time
                   ///< at the start.
  long max_file_bytes = 0;           ///< > 0: larger files fail as on a full disk.
  std::filesystem::path state = {};  ///< Empty: a folder in the test's own.
  std::string listen = "127.0.0.1:0";
  std::function<void(Settings&)> settings = {};  ///< Changes those of the page before the start.
};

/// Starts plumbd and speaks to it. Every wait is for a condition, with a generous end. Killed by
/// its destructor if it still runs; under a sanitizer asked to end, and the sanitizer's output is
/// a failure.
class Plumbd {
 public:
  /// @param folder  Of the test; outlives it. Holds state/, control.sock, log and config.
  explicit Plumbd(const std::filesystem::path& folder, PlumbdOptions options = {});
  ~Plumbd();
  Plumbd(const Plumbd&) = delete;
  Plumbd& operator=(const Plumbd&) = delete;

  /// Until the control socket answers; false if the process ended before.
  bool WaitUntilUp();
  [[nodiscard]] bool HasEnded() const;
  /// Until the status fulfils the condition; a failure of the test if it does not in time. Gives
  /// the last status.
  nlohmann::json WaitFor(const std::string& what,
                         const std::function<bool(const nlohmann::json& status)>& condition);
  nlohmann::json WaitForState(const std::string& state);
  /// Until the scan has taken at least so many frames; under a sanitizer until so many have come.
  nlohmann::json WaitForFrames(int frames);
  /// Until plumbd has logged the text.
  void WaitForLog(const std::string& text);
  /// Presses, lets the sweep play, presses again, waits for the result.
  nlohmann::json ScanOnce();

  [[nodiscard]] nlohmann::json Status() const { return Ask({{"command", "status"}}); }
  nlohmann::json Press(bool is_long = false) const {
    return Ask({{"command", "press"}, {"long", is_long}});
  }
  /// Waits until the driver listens, which plumbd loads after it has begun to answer; a failure of
  /// the test if it then refuses.
  nlohmann::json Sim(const std::string& action, const std::string& argument = {}) const;
  /// One request, one answer; an empty object if there is no answer.
  [[nodiscard]] nlohmann::json Ask(const nlohmann::json& request) const;

  void Signal(int signal) const;
  /// Until it ends. Exit code, or -signal.
  int Wait();
  /// SIGTERM and Wait().
  int Stop();

  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] std::string log() const;
  /// Where the page is served; after WaitUntilUp().
  [[nodiscard]] std::uint16_t port() const;
  /// Of the first account, as the first start prints it.
  [[nodiscard]] std::string setup_code() const;
  [[nodiscard]] const std::filesystem::path& state() const { return state_; }
  [[nodiscard]] std::filesystem::path socket() const { return folder_ / "control.sock"; }
  /// Makes the first account, "engineer" with test::kPassword, by the setup code: logged in. A
  /// failure of the test if it is refused.
  [[nodiscard]] test::HttpClient MakeFirstAccount() const;
  /// The messages sent to systemd, one per line.
  [[nodiscard]] std::string notifications() const;

  [[nodiscard]] int num_descriptors() const;
  [[nodiscard]] int num_threads() const;
  [[nodiscard]] long resident_kb() const;

 private:
  std::filesystem::path folder_, state_;
  int notify_fd_ = -1;
  mutable std::string notified_;
  pid_t pid_ = -1;
};

/// Makes sure that the frames of the virtual sensor that all tests use are rendered. Slow once,
/// quick later. Nothing is done where $PLUMB_TEST_FRAMES names a folder of frames: toolchain/test
/// has the release build render those that the sanitized ones use.
void RenderOnce();

}  // namespace plumb::testing
