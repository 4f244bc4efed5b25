// SPDX-License-Identifier: Apache-2.0
// Start button and light of a real plumbd: its GPIO library is replaced by one of files, and its
// disk has room, regardless of the machine's. Everything above them is the product's.
#include <algorithm>
#include <csignal>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "tests/support/plumbd.hpp"
#include "tests/support/sanitized.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::chrono::milliseconds;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Plumbd;
using Lamps = std::set<std::string>;

/// A time for which the same lamps were on.
struct Phase {
  Lamps on;
  long long length_ms = 0;
};

class DaemonPanelTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  DaemonPanelTest() {
    EXPECT_EQ(::mkfifo((folder_ / "button").c_str(), 0600), 0);
    button_ = ::open((folder_ / "button").c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    std::ofstream(folder_ / "plumb.toml")
        << "[button]\nline = \"start\"\n[light]\nred = \"red\"\ngreen = \"green\"\nblue = "
           "\"blue\"\n"
        << "beeper = \"beeper\"\n";
  }
  ~DaemonPanelTest() override { ::close(button_); }

  [[nodiscard]] testing::PlumbdOptions Options(std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"--config", folder_ / "plumb.toml"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return {.arguments = arguments,
            .environment = {{"LD_PRELOAD", PLUMB_FAKE_GPIOD ":" PLUMB_DISK_USE},
                            {"PLUMB_FAKE_GPIO", folder_.path()},
                            {"PLUMB_DISK_USED_PERCENT", "50"}},
            .settings = [](Settings& settings) { settings.auto_stop_s = 100; }};
  }

  void Edge(char edge) const { ASSERT_EQ(::write(button_, &edge, 1), 1); }
  /// A contact that bounces for some milliseconds before it stays.
  void EdgeWithChatter(char edge) const {
    for (int i = 0; i < 6; ++i) {
      Edge(i % 2 == 0 ? edge : static_cast<char>('0' + '1' - edge));
      std::this_thread::sleep_for(milliseconds(2));
    }
    Edge(edge);
  }
  /// Down, past the debounce, up: the hand's time is part of what is tested.
  void Press(milliseconds held = milliseconds(testing::kIsSanitized ? 600 : 120)) const {
    EdgeWithChatter('1');
    std::this_thread::sleep_for(held);
    EdgeWithChatter('0');
  }

  /// Until the sensor has given so many more pairs: time that passes on a machine of any speed.
  static json WaitForPairs(Plumbd& plumbd, int more) {
    const int before = plumbd.Status()["sensor"]["pairs"].get<int>();
    return plumbd.WaitFor(
        "time", [&](const json& s) { return s["sensor"]["pairs"].get<int>() >= before + more; });
  }

  /// From now on only what the lamps do next counts.
  void ForgetLamps() { begin_ = ReadLamps().size(); }
  /// What the lamps did: phases of 5 ms and more (lines are switched one after the other); the last
  /// goes on.
  [[nodiscard]] std::vector<Phase> Phases() const {
    const auto lines = ReadLamps();
    std::vector<Phase> phases;
    Lamps on;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const auto& [time_ms, line, value] = lines[i];
      value ? void(on.insert(line)) : void(on.erase(line));
      const long long length_ms =
          i + 1 < lines.size() ? std::get<0>(lines[i + 1]) - time_ms : 1'000'000;
      if (i + 1 < begin_ || length_ms < 5) continue;
      phases.push_back({on, length_ms});
    }
    return phases;
  }
  [[nodiscard]] std::size_t NumPhases(const Lamps& on) const {
    const std::vector<Phase> phases = Phases();
    return static_cast<std::size_t>(std::count_if(
        phases.begin(), phases.end(), [&](const Phase& phase) { return phase.on == on; }));
  }
  void WaitForPhases(Plumbd& plumbd, const Lamps& on, std::size_t count) const {
    plumbd.WaitFor("lamps", [&](const json&) { return NumPhases(on) >= count; });
  }
  /// Median length of the phases that have ended.
  [[nodiscard]] long long Length_ms(const Lamps& on) const {
    std::vector<long long> lengths;
    for (const Phase& phase : Phases()) {
      if (phase.on == on && phase.length_ms < 1'000'000) lengths.push_back(phase.length_ms);
    }
    if (lengths.empty()) return 0;
    std::nth_element(lengths.begin(), lengths.begin() + std::ssize(lengths) / 2, lengths.end());
    return lengths[lengths.size() / 2];
  }
  /// The median: no timer is early, and a busy machine may be late.
  void ExpectLength(const Lamps& on, long long length_ms) const {
    EXPECT_GE(Length_ms(on), length_ms - 5);
    testing::ExpectBelow("length of a phase in ms", static_cast<double>(Length_ms(on)),
                         static_cast<double>(length_ms * 3 / 2 + 51));
  }
  [[nodiscard]] Lamps Seen() const {
    Lamps seen;
    for (const Phase& phase : Phases()) seen.insert(phase.on.begin(), phase.on.end());
    return seen;
  }

  testing::TempFolder folder_;

 private:
  [[nodiscard]] std::vector<std::tuple<long long, std::string, bool>> ReadLamps() const {
    std::vector<std::tuple<long long, std::string, bool>> lines;
    std::ifstream file(folder_ / "lights");
    long long time_ms = 0;
    std::string line;
    for (bool value = false; file >> time_ms >> line >> value;)
      lines.emplace_back(time_ms, line, value);
    return lines;
  }

  int button_ = -1;
  std::size_t begin_ = 0;
};

TEST_F(DaemonPanelTest, AButtonThatChattersIsPressedOnceForEachPress) {
  Plumbd plumbd(folder_.path(), Options());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  Press();
  EXPECT_EQ(plumbd.WaitForFrames(60)["state"], "scanning") << "a second press would have ended it";
  Press();
  plumbd.WaitForState("result");
  EXPECT_THAT(plumbd.log(), Not(HasSubstr("ignored"))) << "a third one would have been logged";
  Press(milliseconds(1700));
  plumbd.WaitForState("ready");
  EXPECT_EQ(WaitForPairs(plumbd, 15)["state"], "ready") << "the end of a long press is no press";
}

TEST_F(DaemonPanelTest, AButtonHeldAtTheStartDoesNothingUntilItWasReleased) {
  std::ofstream(folder_ / "held") << "";
  Plumbd plumbd(folder_.path(), Options());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  EXPECT_EQ(WaitForPairs(plumbd, 75)["state"], "ready") << "longer than a long press";
  EdgeWithChatter('0');
  EXPECT_EQ(WaitForPairs(plumbd, 15)["state"], "ready");
  EXPECT_THAT(plumbd.log(), Not(HasSubstr("ignored")));
  Press();
  plumbd.WaitForState("scanning");
}

TEST_F(DaemonPanelTest, PressedDuringWorkingItIsIgnoredAndHeldDownItDiscardsTheScan) {
  Plumbd plumbd(folder_.path(), Options());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  Press();
  plumbd.WaitForFrames(90);
  EdgeWithChatter('1');
  WaitForPairs(plumbd,
               4);  // longer than contacts chatter, however many frames tracking has dropped by now
  ASSERT_EQ(plumbd.Press()["ok"], true);  // the page ends the sweep while the button is down
  plumbd.WaitFor("working", [](const json& s) { return s["state"] != "scanning"; });
  EdgeWithChatter('0');
  plumbd.WaitForLog("short_press ignored in state working");
  plumbd.WaitForState("result");
  Press();
  plumbd.WaitForFrames(60);
  EdgeWithChatter('1');
  plumbd.WaitForState("ready");  // once held down for long enough, in any state
  EdgeWithChatter('0');
  EXPECT_EQ(WaitForPairs(plumbd, 15)["state"], "ready");
}

TEST_F(DaemonPanelTest, AButtonThatIsGoneIsToldAndThePageStillWorks) {
  Plumbd plumbd(folder_.path(), Options());
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  Edge('x');
  plumbd.WaitForLog("the button does not work any more");
  EXPECT_EQ(plumbd.Press()["ok"], true);
  plumbd.WaitForFrames(5);
}

TEST_F(DaemonPanelTest, TheLightShowsNoSensorReadyAndFault) {
  Plumbd plumbd(folder_.path(), Options({"--sim-unplugged"}));
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("no_sensor");
  WaitForPhases(plumbd, {"red"}, 3);
  EXPECT_EQ(Seen(), Lamps{"red"});
  ExpectLength({"red"}, 150);
  ExpectLength({}, 1850);
  plumbd.Sim("plug");
  plumbd.WaitForState("ready");
  WaitForPhases(plumbd, {"green"}, 1);
  ForgetLamps();
  WaitForPairs(plumbd, 45);
  EXPECT_EQ(Phases().size(), 1U) << "steady";
  EXPECT_EQ(Phases().front().on, Lamps{"green"});
  plumbd.Sim("stall");
  plumbd.WaitForState("fault");
  ForgetLamps();
  WaitForPhases(plumbd, {"red"}, 10);
  EXPECT_EQ(Seen(), Lamps{"red"});
  ExpectLength({"red"}, 80);
  ExpectLength({}, 80);
  EXPECT_EQ(plumbd.Stop(), 0);
  EXPECT_EQ(Phases().back().on, Lamps{}) << "the lamps are off after plumbd has ended";
}

TEST_F(DaemonPanelTest, TheLightShowsThatTheDiskIsNearlyFull) {
  testing::PlumbdOptions options = Options();
  options.environment["PLUMB_DISK_USED_PERCENT"] = "80";
  Plumbd plumbd(folder_.path(), options);
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  WaitForPhases(plumbd, {"green"}, 1);
  ForgetLamps();
  WaitForPhases(plumbd, {"red", "green"}, 4);
  EXPECT_EQ(Seen(), (Lamps{"red", "green"}));
  ExpectLength({"red", "green"}, 150);
}

TEST_F(DaemonPanelTest, WhileTheServiceDoesNotRunTheLightSaysSo) {
  testing::PlumbdOptions options = Options({"--show-stopped"});  // answers at no socket
  options.settings = {};  // the store would be opened for them
  Plumbd light(folder_.path(), options);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (NumPhases({"red"}) < 3 && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(milliseconds(50));
  EXPECT_EQ(Seen(), Lamps{"red"});
  ExpectLength({"red"}, 1000);
  EXPECT_EQ(light.Stop(), 0);
  EXPECT_EQ(Phases().back().on, Lamps{});
  EXPECT_FALSE(fs::exists(light.state())) << "nothing stored is touched";
}

TEST_F(DaemonPanelTest, ABadKeyElsewhereInTheConfigurationIsAFaultThatTheLightShows) {
  std::ofstream(folder_ / "plumb.toml", std::ios::app) << "quotas = 3\n";
  {
    Plumbd plumbd(folder_.path(), Options());
    ASSERT_TRUE(plumbd.WaitUntilUp());
    EXPECT_THAT(plumbd.WaitForState("fault")["reason"], HasSubstr("quotas"));
    WaitForPhases(plumbd, {"red"}, 10);
    EXPECT_EQ(Seen(), Lamps{"red"});
    ExpectLength({"red"}, 80);
    EXPECT_EQ(plumbd.Stop(), 0);
  }
  ForgetLamps();
  Plumbd light(folder_.path(), Options({"--show-stopped"}));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (NumPhases({"red"}) < 3 && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(milliseconds(50));
  ExpectLength({"red"}, 1000);
  EXPECT_EQ(light.Stop(), 0);
}

TEST_F(DaemonPanelTest, TheLightShowsScanningWorkingAndResults) {
  testing::PlumbdOptions options = Options();
  options.scenes = 2;
  Plumbd plumbd(folder_.path(), options);
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  ForgetLamps();
  plumbd.ScanOnce();
  EXPECT_EQ(plumbd.Status()["light"], "done") << "there was nothing to compare with";
  // Under a sanitizer most frames are dropped, and the sweep may rightly seem too fast.
  if (!testing::kIsSanitized) {
    EXPECT_EQ(NumPhases({"blue", "beeper"}), 1U) << "a beep at the start";
  }
  EXPECT_GE(NumPhases({"blue"}), 1U)
      << "steady; how often it comes back while the result is made depends on the machine";
  WaitForPhases(plumbd, {"green"}, 3);
  EXPECT_EQ(NumPhases({"green", "beeper"}), 1U);
  if (!testing::kIsSanitized) {
    EXPECT_EQ(Seen(), (Lamps{"blue", "beeper", "green"}));
  }
  plumbd.Sim("next-scene");
  plumbd.ScanOnce();
  ForgetLamps();
  WaitForPhases(plumbd, {"red", "green"}, 3);
  ExpectLength({"red", "green"}, 800);
  EXPECT_EQ(Seen().count("blue"), 0U);
}

TEST_F(DaemonPanelTest, TheLightShowsASweepThatIsTooFastAndAnAnswerThatIsNone) {
  testing::PlumbdOptions options = Options();
  options.sweep_frames = 30;  // in one second what a hand does in ten
  Plumbd plumbd(folder_.path(), options);
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  ForgetLamps();
  Press();
  plumbd.WaitFor("too fast", [](const json& s) { return s["light"] == "too_fast"; });
  WaitForPhases(plumbd, {"red", "green", "beeper"}, 2);
  EXPECT_EQ(plumbd.Press(/*is_long=*/true)["ok"], true);
  plumbd.WaitForState("ready");
  ForgetLamps();
  plumbd.Press();
  plumbd.Press();  // before a frame came
  plumbd.WaitFor("no answer", [](const json& s) { return s["light"] == "no_answer"; });
  WaitForPhases(plumbd, {"red"}, 1);
  EXPECT_EQ(NumPhases({"red", "beeper"}), 2U);
}

}  // namespace
}  // namespace plumb
