// SPDX-License-Identifier: Apache-2.0
// The gate line of a real plumbd that monitors, through a GPIO library that notes its edges. What
// stops the pulses is hold: a killed process, a stopped one, a loop that stalls, and `out`.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/support/plumbd.hpp"
#include "tests/support/sanitized.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using testing::Plumbd;

// The longest time without an edge that a circuit still takes for `in` (docs/monitoring.md).
constexpr long long kHold_ms = 150;

struct GateEdge {
  long long time_ms = 0;  ///< Steady clock.
  bool rises = false;
};

class DaemonGateTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  DaemonGateTest() {
    EXPECT_EQ(::mkfifo((folder_ / "button").c_str(), 0600), 0);
    button_ = ::open((folder_ / "button").c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    std::ofstream(folder_ / "plumb.toml")
        << "[button]\nline = \"start\"\n[monitor]\ngate_line = \"gate\"\n";
  }
  ~DaemonGateTest() override { ::close(button_); }

  /// A second sweep over a body that lies as in the reference, so that monitoring says `in`.
  [[nodiscard]] testing::PlumbdOptions Options() const {
    return {.arguments = {"--sim-rest", "--config", folder_ / "plumb.toml"},
            .environment = {{"LD_PRELOAD", PLUMB_FAKE_GPIOD ":" PLUMB_DISK_USE},
                            {"PLUMB_FAKE_GPIO", folder_.path()},
                            {"PLUMB_DISK_USED_PERCENT", "50"}}};
  }

  [[nodiscard]] std::vector<GateEdge> Edges() const {
    std::vector<GateEdge> edges;
    std::ifstream file(folder_ / "lights");
    long long time_ms = 0;
    std::string line;
    for (bool value = false; file >> time_ms >> line >> value;) {
      const bool before = !edges.empty() && edges.back().rises;
      if (line == "gate" && value != before) edges.push_back({time_ms, value});
    }
    return edges;
  }
  [[nodiscard]] std::size_t NumPulses() const {
    std::size_t pulses = 0;
    for (const GateEdge& edge : Edges()) pulses += edge.rises ? 1 : 0;
    return pulses;
  }
  static long long Now_ms() {
    return std::chrono::duration_cast<milliseconds>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  static void WaitFor_ms(long long time_ms) {
    std::this_thread::sleep_until(std::chrono::steady_clock::time_point(milliseconds(time_ms)));
  }
  /// Until a second of pulses has come, as the status says.
  void WaitForPulses(Plumbd& plumbd) const {
    const std::size_t before = NumPulses();
    plumbd.WaitFor("pulses", [&](const json& status) {
      return status["monitor"]["advice"] == "in" && NumPulses() >= before + 10;
    });
  }
  /// From the time on, at which pulses came, the line is steady after as long as a circuit waits,
  /// and remains so.
  void ExpectSteadySince(long long time_ms) const {
    ASSERT_FALSE(Edges().empty());
    EXPECT_LE(time_ms - Edges().back().time_ms, 10 * kHold_ms) << "there were pulses";
    WaitFor_ms(time_ms + 5 * kHold_ms);
    EXPECT_LE(Edges().back().time_ms, time_ms + kHold_ms);
  }

  void BeginMonitoring(Plumbd& plumbd) const {
    (void)plumbd.ScanOnce();
    (void)plumbd.ScanOnce();
    EXPECT_EQ(NumPulses(), 0u) << "nothing is monitored";
    plumbd.Sim("mount");
    ASSERT_TRUE(plumbd.Ask({{"command", "monitor"}, {"action", "start"}}).value("ok", false));
  }

  testing::TempFolder folder_;
  int button_ = -1;
};

TEST_F(DaemonGateTest, EdgesComeOnlyWhileItIsIn) {
  Plumbd plumbd(folder_.path(), Options());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  BeginMonitoring(plumbd);
  WaitForPulses(plumbd);
  const json in = plumbd.Status();
  EXPECT_EQ(in["monitor"]["advice"], "in");
  // A pulse for each judged group of frames: ten a second, so that a circuit of 150 ms stays on.
  const std::vector<GateEdge> edges = Edges();
  std::vector<long long> apart_ms;
  for (std::size_t i = edges.size() - 18; i + 2 < edges.size(); ++i)
    if (edges[i].rises) apart_ms.push_back(edges[i + 2].time_ms - edges[i].time_ms);
  std::sort(apart_ms.begin(), apart_ms.end());
  EXPECT_NEAR(apart_ms[apart_ms.size() / 2], 100.0, testing::kIsSanitized ? 60.0 : 25.0);

  plumbd.Sim("move");
  plumbd.WaitFor("out", [](const json& s) { return s["monitor"]["advice"] == "out"; });
  const std::size_t pulses = NumPulses();
  const int frames = plumbd.Status()["monitor"]["frames"].get<int>();
  plumbd.WaitFor("a second outside", [&](const json& status) {
    return status["monitor"]["frames"].get<int>() > frames + 30;
  });
  EXPECT_EQ(NumPulses(), pulses) << "no edge while it is out";
  EXPECT_FALSE(Edges().back().rises);

  plumbd.Sim("mount");  // the body lies again where it lay
  WaitForPulses(plumbd);
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_FALSE(Edges().back().rises) << "left low";
}

TEST_F(DaemonGateTest, AStalledLoopAStoppedAndAKilledProcessLeaveASteadyLine) {
  Plumbd plumbd(folder_.path(), Options());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  BeginMonitoring(plumbd);
  WaitForPulses(plumbd);

  // The loop hangs in a driver's call; the threads that see and judge the body go on.
  const std::filesystem::path stall = folder_ / "stall";
  ASSERT_EQ(::mkfifo(stall.c_str(), 0600), 0);
  const char kStall = 's';
  ASSERT_EQ(::write(button_, &kStall, 1), 1);
  ExpectSteadySince(Now_ms());
  ::close(::open(stall.c_str(), O_WRONLY | O_CLOEXEC));
  WaitForPulses(plumbd);

  plumbd.Signal(SIGSTOP);
  ExpectSteadySince(Now_ms());
  plumbd.Signal(SIGCONT);
  WaitForPulses(plumbd);

  plumbd.Signal(SIGKILL);
  const long long killed_ms = Now_ms();
  EXPECT_EQ(plumbd.Wait(), -SIGKILL);
  ExpectSteadySince(killed_ms);
}

}  // namespace
}  // namespace plumb
