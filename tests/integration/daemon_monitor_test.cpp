// SPDX-License-Identifier: Apache-2.0
// Live monitoring by the whole plumbd: two sweeps, then the sensor at rest over the body, which is
// moved while it is watched.
#include <thread>

#include <gmock/gmock.h>

#include "tests/support/plumbd.hpp"

namespace plumb::testing {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;

class DaemonMonitorTest : public ::testing::Test {
 protected:
  static json Monitor(const Plumbd& plumbd, const char* action) {
    return plumbd.Ask({{"command", "monitor"}, {"action", action}});
  }
  TempFolder folder_;
};

TEST_F(DaemonMonitorTest, WatchesTheBodyAfterASweepAndHoldsWhenItMoves) {
  Plumbd plumbd(folder_.path(), {.arguments = {"--sim-rest"}, .scenes = 2});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  EXPECT_FALSE(Monitor(plumbd, "start").value("ok", true)) << "nothing was scanned yet";
  (void)plumbd.ScanOnce();
  plumbd.Sim("next-scene");
  (void)plumbd.ScanOnce();
  plumbd.Sim("mount");
  ASSERT_TRUE(Monitor(plumbd, "start").value("ok", false));
  EXPECT_FALSE(Monitor(plumbd, "start").value("ok", true)) << "once";
  const json begun = plumbd.WaitFor("numbers", [](const json& status) {
    return status["state"] == "monitoring" && status["monitor"]["state"] == "monitoring" &&
           status["monitor"]["against_reference"].is_object();
  });
  EXPECT_TRUE(begun["monitor"]["since_zero"].is_object());
  EXPECT_LT(begun["monitor"]["age_s"], 0.5);

  plumbd.Sim("move");
  plumbd.WaitFor("the motion", [](const json& status) {
    const json& numbers = status["monitor"]["since_zero"];
    return numbers.is_object() && std::abs(numbers["lateral_mm"].get<double>()) +
                                          std::abs(numbers["longitudinal_mm"].get<double>()) >
                                      3.5;
  });
  // No image any more: first unknown, then no number, and nothing else ends.
  plumbd.Sim("stall");
  plumbd.WaitFor("an unknown state", [](const json& status) {
    return status["monitor"]["advice"] == "unknown" && status["monitor"]["reason"] == "no_image";
  });
  plumbd.Sim("resume");
  plumbd.Press();
  plumbd.WaitForState("ready");
  // The sensor is where it was: the next press goes on watching. Taken up again, it starts a sweep.
  plumbd.WaitFor("rest", [](const json& status) {
    return status["press"] == "monitoring" && status["light"] == "ready_to_monitor";
  });
  plumbd.Press();
  plumbd.WaitForState("monitoring");
  plumbd.Press();
  plumbd.WaitForState("ready");
  plumbd.Sim("next-scene");
  plumbd.WaitFor("a hand", [](const json& status) { return status["press"] == "sweep"; });
  plumbd.Sim("mount");
  plumbd.WaitFor("rest again", [](const json& status) { return status["press"] == "monitoring"; });
  plumbd.Press();
  plumbd.WaitForState("monitoring");
  plumbd.Sim("unplug");
  plumbd.WaitForState("no_sensor");
  const json ended = plumbd.Status()["monitor"];
  EXPECT_EQ(ended["active"], false);
  EXPECT_TRUE(ended["since_zero"].is_null());
  EXPECT_NE(ended["ended"], "");
  EXPECT_EQ(plumbd.Stop(), 0);
}

}  // namespace
}  // namespace plumb::testing
