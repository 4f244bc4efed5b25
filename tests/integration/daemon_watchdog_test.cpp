// SPDX-License-Identifier: Apache-2.0
// systemd's watchdog is fed while the workers work, and not while one hangs.
#include <sys/ptrace.h>
#include <sys/wait.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/plumbd.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::Plumbd;

int TimesFed(const Plumbd& plumbd) {
  const std::string reported = plumbd.notifications();
  int count = 0;
  for (std::size_t at = reported.find("WATCHDOG=1"); at != std::string::npos;
       at = reported.find("WATCHDOG=1", at + 1))
    ++count;
  return count;
}

/// Holds every thread of a process but its first, as a driver holds a worker that never comes back
/// from it; lets them go on when it is destroyed.
class HeldWorkers {
 public:
  explicit HeldWorkers(pid_t process) {
    for (const auto& entry : fs::directory_iterator("/proc/" + std::to_string(process) + "/task")) {
      const pid_t thread = std::stoi(entry.path().filename());
      if (thread == process) continue;
      if (::ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0) continue;
      if (::ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) == 0 &&
          ::waitpid(thread, nullptr, __WALL) == thread)
        threads_.push_back(thread);
    }
  }
  ~HeldWorkers() {
    for (const pid_t thread : threads_) ::ptrace(PTRACE_DETACH, thread, nullptr, nullptr);
  }
  HeldWorkers(const HeldWorkers&) = delete;
  HeldWorkers& operator=(const HeldWorkers&) = delete;
  [[nodiscard]] std::size_t count() const { return threads_.size(); }

 private:
  std::vector<pid_t> threads_;
};

class DaemonWatchdogTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }
  testing::TempFolder folder_;
};

TEST_F(DaemonWatchdogTest, ItIsNotFedWhileAWorkerHangsAndFedAgainAfter) {
  Plumbd plumbd(folder_.path(), {.environment = {{"WATCHDOG_USEC", "300000"}}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  const int at_first = TimesFed(plumbd);
  plumbd.WaitFor("food", [&](const nlohmann::json&) { return TimesFed(plumbd) >= at_first + 3; });
  {
    const HeldWorkers held(plumbd.pid());
    ASSERT_GT(held.count(), 0U) << "threads can be held by ptrace here";
    plumbd.WaitForLog("the watchdog is not fed");  // after sensor_silence_s, half a minute
    const int before = TimesFed(plumbd);
    std::this_thread::sleep_for(std::chrono::seconds(1));  // the time of ten feedings is tested
    EXPECT_EQ(TimesFed(plumbd), before) << "the loop goes on, but it must not feed";
  }
  const int after = TimesFed(plumbd);
  plumbd.WaitFor("food again",
                 [&](const nlohmann::json&) { return TimesFed(plumbd) >= after + 3; });
  EXPECT_EQ(plumbd.Stop(), 0);
}

}  // namespace
}  // namespace plumb
