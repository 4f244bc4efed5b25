// SPDX-License-Identifier: Apache-2.0
// Faults of room, hand and prints through the whole chain, at the size and number of frames of the
// README's accuracy figures, on a unit of the simulator that nothing was chosen on. Bounds are 20 %
// above the measured figures. Without any of these faults the pair is off by 0.27 mm and 0.034 deg.
// All but the first run with: ctest --test-dir build/release -C Long -L long -R FaultSuites

#include <cmath>
#include <cstdio>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::IsEmpty;

class FaultSuites : public CommandLineTest {
 protected:
  /// Simulates two scans of a unit with the fault and evaluates them, see Evaluated().
  json PairWith(const std::string& fault) {
    Simulate(suite(), 61, 61, fault + "=on");
    return Evaluated(suite());
  }
  static void Simulate(const fs::path& suite, int unit, int seed, const std::string& fault) {
    const RunResult made =
        Plumb({"simulate", "--suite", "demo", "--frames", "100", "--unit", std::to_string(unit),
               "--seed", std::to_string(seed), "--fault", fault, "--out", suite});
    EXPECT_EQ(made.exit_code, 0) << made.err;
  }
  /// The figures of the suite's only pair, after what has to hold with every fault has been
  /// checked.
  json Evaluated(const fs::path& suite, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"evaluate", suite, "--out", folder_ / "out", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const RunResult result = Plumb(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    figures_ = json::parse(result.out);
    EXPECT_EQ(figures_.at("pairs").size(), 1U);
    json pair = figures_.at("pairs").at(0);
    std::printf("%s mm, %s deg\n", pair.at("translation_mm").dump().c_str(),
                pair.at("rotation_deg").dump().c_str());
    EXPECT_EQ(pair.at("verdict"), "move");
    EXPECT_EQ(pair.at("numbers").size(), 6U);
    // One number in twenty may lie outside of its 95 % interval, in each suite other ones; 1.5
    // times the interval are three standard deviations.
    for (const auto& [name, number] : pair.at("numbers").items())
      EXPECT_LE(std::abs(number.at("value").get<double>() - number.at("truth").get<double>()),
                1.5 * number.at("u95").get<double>())
          << name << ": " << number;
    for (const auto& [name, scene] : figures_.at("scenes").items())
      EXPECT_EQ(scene.at("frames").at("tracked"), scene.at("frames").at("total")) << name;
    return pair;
  }
  /// The result of `plumb compare` of the two scenes.
  json Compared() {
    const fs::path scenes = folder_ / "out" / "scenes";
    const RunResult result = Plumb(
        {"compare", scenes / "reference", scenes / "moved", "--out", folder_ / "result", "--json"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out);
  }
  [[nodiscard]] json TrueMarkers(const std::string& scene) const {
    return json::parse(ReadText(suite() / "truth" / scene / "markers.json"));
  }
  [[nodiscard]] fs::path suite() const { return folder_ / "suite"; }

  json figures_;
};
using FaultSuitesLong = FaultSuites;

std::set<std::string> Rejected(const json& result) {
  std::set<std::string> ids;
  for (const auto& [id, residual_m] : result.at("alignment").at("markers_rejected").items())
    ids.insert(id);
  return ids;
}

TEST_F(FaultSuites, AMarkerThatWasMovedBetweenTheScansIsNamedAndNoOther) {
  const json pair = PairWith("moved-marker");
  EXPECT_LE(pair.at("translation_mm"), 0.37);  // Measured: 0.24.
  EXPECT_LE(pair.at("rotation_deg"), 0.07);    // Measured: 0.058.
  const json before = TrueMarkers("reference").at("markers");
  const json after = TrueMarkers("moved").at("markers");
  std::set<std::string> moved;
  for (const auto& [id, marker] : before.items())
    if (marker != after.at(id)) moved.insert(id);
  ASSERT_EQ(moved.size(), 1U);
  const json result = Compared();
  EXPECT_EQ(Rejected(result), moved);  // By 13 mm.
  EXPECT_THAT(result.at("warnings"), ElementsAre("marker " + *moved.begin() +
                                                 " moved 13 mm since the reference; ignored"));
}

// One marker is pushed in each sweep, and not the same one in both.
TEST_F(FaultSuitesLong, AMarkerThatIsPushedDuringASweepDoesNoHarmAndNoOtherIsAccused) {
  const json pair = PairWith("moving-marker");
  EXPECT_LE(pair.at("translation_mm"), 0.40);  // Measured: 0.33.
  EXPECT_LE(pair.at("rotation_deg"), 0.045);   // Measured: 0.037.
  const int first = TrueMarkers("reference").at("pushed").at("id");
  const int second = TrueMarkers("moved").at("pushed").at("id");
  ASSERT_NE(first, second);
  // The first scan shows its marker mostly after the push, so that in the second, where it lies as
  // before, it has moved. The second scan shows its own marker mostly before the push, and that is
  // where the first one has it.
  EXPECT_THAT(Rejected(Compared()), ElementsAre(std::to_string(first)));
}

TEST_F(FaultSuitesLong, AHandInTheView) {
  const json pair = PairWith("hand");
  EXPECT_LE(pair.at("translation_mm"), 0.33);  // Measured: 0.27.
  EXPECT_LE(pair.at("rotation_deg"), 0.043);   // Measured: 0.036.
  EXPECT_THAT(Rejected(Compared()), IsEmpty());
}

TEST_F(FaultSuitesLong, TheSensorsCableInTheView) {
  const json pair = PairWith("cable");
  EXPECT_LE(pair.at("translation_mm"), 0.30);  // Measured: 0.25.
  EXPECT_LE(pair.at("rotation_deg"), 0.057);   // Measured: 0.048.
  EXPECT_THAT(Rejected(Compared()), IsEmpty());
}

// All prints of the room are too large or too small by up to 0.5 %, and so are all lengths.
TEST_F(FaultSuitesLong, PrintsOfAWrongScale) {
  const json pair = PairWith("print-scale");
  EXPECT_LE(pair.at("translation_mm"), 0.49);  // Measured: 0.41.
  EXPECT_LE(pair.at("rotation_deg"), 0.052);   // Measured: 0.043.
  for (const auto& [name, scene] : figures_.at("scenes").items()) {
    const double permille = std::abs(scene.at("marker_scale_permille").get<double>());
    EXPECT_GE(permille, 2.5) << name << ": the fault is on";
    EXPECT_LE(permille, 4.8) << name;  // Measured: 4.0.
  }
  EXPECT_THAT(Rejected(Compared()), IsEmpty());
}

// Unit 69 has been on for 27 s, which makes its depth 0.56 % too short; without the fault it is
// warm. Each profile learns from the same two sweeps six times, so that it states too small an
// uncertainty.
TEST_F(FaultSuitesLong, AProfileLearnedColdDoesNotFailAWarmScansIntervalsNorTheOtherWayRound) {
  const fs::path cold = folder_ / "cold", warm = folder_ / "warm";
  Simulate(cold, 69, 70, "warm-up=on");
  Simulate(warm, 69, 171, "warm-up=off");
  const auto learned_from = [&](const fs::path& suite) {
    std::vector<std::string> arguments = {"calibrate", "--out", suite.string() + ".json"};
    for (int i = 0; i < 6; ++i)
      for (const char* name : {"reference", "moved"})
        arguments.push_back(suite / "recordings" / name);
    const RunResult result = Plumb(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(json::parse(ReadText(suite.string() + ".json")).at("sweeps"), 12);
    return suite.string() + ".json";
  };
  const std::string profile_cold = learned_from(cold), profile_warm = learned_from(warm);
  const auto scale = [](const std::string& profile) {
    return json::parse(ReadText(profile)).at("calibration").at("depth_scale").get<double>();
  };
  std::printf("depth scale: %.4f cold, %.4f warm\n", scale(profile_cold), scale(profile_warm));
  EXPECT_GT(scale(profile_cold) - scale(profile_warm), 0.003) << "they do differ";
  const json warm_pair = Evaluated(warm, {"--sensor-profile", profile_cold});
  EXPECT_LE(warm_pair.at("translation_mm"), 0.20);  // Measured: 0.17.
  const json cold_pair = Evaluated(cold, {"--sensor-profile", profile_warm});
  EXPECT_LE(cold_pair.at("translation_mm"), 0.29);  // Measured: 0.24.
}

}  // namespace
}  // namespace plumb
