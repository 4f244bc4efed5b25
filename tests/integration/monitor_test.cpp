// SPDX-License-Identifier: Apache-2.0
// `plumb monitor` from outside, on a small recording of a sensor at rest.
#include <cmath>
#include <map>
#include <sstream>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/integration/command_line.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::StartsWith;

using Row = std::map<std::string, std::string>;

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line + ",");
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

std::vector<Row> RowsOf(const fs::path& csv) {
  std::istringstream in(ReadText(csv));
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> names = Cells(line);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const std::vector<std::string> cells = Cells(line);
    EXPECT_EQ(cells.size(), names.size());
    Row& row = rows.emplace_back();
    for (std::size_t i = 0; i < std::min(cells.size(), names.size()); ++i) row[names[i]] = cells[i];
  }
  return rows;
}

class MonitorTest : public CommandLineTest {
 protected:
  [[nodiscard]] static fs::path Recording() {
    return SmallLiveSuite() / "recordings" / "live_steps";
  }
};

TEST_F(MonitorTest, FollowsABodyThatIsMovedWhileItBreathes) {
  const fs::path out = folder_ / "monitoring";
  const RunResult result =
      Plumb({"monitor", Recording(), "--scene", SmallLiveScene(), "--out", out});
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  EXPECT_THAT(ReadText(out / "monitor.csv"),
              StartsWith("time_s,state,advice,lateral_mm,longitudinal_mm,vertical_mm,pitch_deg,"
                         "roll_deg,yaw_deg,lateral_u95_mm,longitudinal_u95_mm,vertical_u95_mm,"
                         "pitch_u95_deg,roll_u95_deg,yaw_u95_deg,breathing_mm"));
  const std::vector<Row> rows = RowsOf(out / "monitor.csv");
  EXPECT_GE(rows.size(), 150U) << "a line for each depth image";
  const double start_s = std::stod(rows.front().at("time_s"));
  bool was_in = false;
  for (const Row& row : rows) {
    const double time_s = std::stod(row.at("time_s")) - start_s;
    if (time_s < 0.9) {
      EXPECT_EQ(row.at("state"), "mounting") << time_s;
    }
    if (time_s < 8.5) {
      EXPECT_EQ(row.at("lateral_mm"), "") << "no numbers before the zero";
    }
    if (row.at("state") != "monitoring") continue;
    const double x = std::stod(row.at("lateral_mm")), y = std::stod(row.at("longitudinal_mm")),
                 z = std::stod(row.at("vertical_mm"));
    const double shift_mm = std::sqrt(x * x + y * y + z * z);
    if (time_s < 12.8) {
      was_in = was_in || row.at("advice") == "in";
      EXPECT_LT(shift_mm, 1.8) << time_s;
    }
    if (time_s > 14.0 && time_s < 16.8) {
      EXPECT_NEAR(shift_mm, 2.0, 1.8) << time_s;
    }
    if (time_s > 18.0) {
      EXPECT_NEAR(shift_mm, std::sqrt(13.0), 1.8) << time_s;
    }
  }
  EXPECT_TRUE(was_in);
  const json facts = json::parse(ReadText(out / "monitor.json"));
  for (const char* key : {"version", "settings", "zero", "drift", "breathing", "events"})
    EXPECT_TRUE(facts.contains(key)) << key;
  EXPECT_EQ(facts.at("centroid").size(), 3U);
  // Of 160 frames: a second of mounting, eight of zeroing, and 0.6 in which the zero is fitted.
  EXPECT_GE(facts.at("states").at("monitoring"), 78);
}

TEST_F(MonitorTest, TwoSensorsGoOnWhileAnArmCoversOneAndAfterItWasPushed) {
  const fs::path out = folder_ / "monitoring", recordings = SmallLiveSuite() / "recordings";
  const RunResult result =
      Plumb({"monitor", recordings / "live_two_left", recordings / "live_two_right", "--scene",
             SmallLiveScene(), "--out", out});
  ASSERT_EQ(result.exit_code, 0) << result.err << result.out;
  const std::vector<Row> rows = RowsOf(out / "monitor.csv");
  const double start_s = std::stod(rows.front().at("time_s"));
  std::map<std::string, int> used_late, lines_of;
  int pushed_lines = 0;
  bool by_both = false, by_one = false;
  double last_s = 0;
  for (const Row& row : rows) {
    const double time_s = std::stod(row.at("time_s")) - start_s;
    EXPECT_GE(time_s, last_s) << "one clock";
    last_s = time_s;
    ++lines_of[row.at("sensor")];
    if (row.at("state") == "moved_sensor") {
      ++pushed_lines;
      EXPECT_EQ(row.at("sensor"), "1");
      EXPECT_EQ(row.at("advice"), "unknown");
      EXPECT_EQ(row.at("lateral_mm"), "");
    }
    if (row.at("state") != "monitoring") continue;
    if (time_s < 13.0) by_both = by_both || row.at("sensors_used") == "2";
    if (time_s > 14.0 && time_s < 15.5) by_one = by_one || row.at("sensors_used") == "1";
    if (time_s > 19.5) ++used_late[row.at("sensors_used")];
  }
  EXPECT_TRUE(by_both);
  EXPECT_TRUE(by_one) << "covered by the arm";
  EXPECT_GT(used_late["1"], 0);
  EXPECT_EQ(used_late["2"], 0) << "one that was pushed does not come back";
  EXPECT_EQ(lines_of["1"], lines_of["2"]) << "a line for each depth image";
  EXPECT_GT(pushed_lines, 0);
  const json facts = json::parse(ReadText(out / "monitor.json"));
  EXPECT_EQ(facts.at("zero").at("sensors").size(), 2U);
  EXPECT_EQ(facts.at("frames"), rows.size());
  EXPECT_FALSE(facts.at("states").contains("moved_sensor"));
}

TEST_F(MonitorTest, TheSameRecordingGivesTheSameNumbers) {
  std::vector<std::string> csv;
  for (const char* name : {"a", "b"}) {
    const fs::path out = folder_ / name;
    ASSERT_EQ(Plumb({"monitor", Recording(), "--scene", SmallLiveScene(), "--out", out}).exit_code,
              0);
    csv.push_back(ReadText(out / "monitor.csv"));
  }
  EXPECT_EQ(csv[0], csv[1]);
}

TEST_F(MonitorTest, ASensorThatMovesNeverBegins) {
  const fs::path out = folder_ / "monitoring";
  const RunResult result = Plumb({"monitor", SmallLiveSuite() / "recordings" / "moved", "--scene",
                                  SmallLiveScene(), "--out", out});
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.out, HasSubstr("monitoring never began"));
  EXPECT_TRUE(fs::is_regular_file(out / "monitor.csv"));
  for (const Row& row : RowsOf(out / "monitor.csv")) EXPECT_EQ(row.at("advice"), "unknown");
}

TEST_F(MonitorTest, HoursAreJudgedOnTheFlyAndGoOnWhereTheyEnded) {
  const fs::path out = folder_ / "hours";
  const auto run = [&](const char* parts) {
    return Plumb({"evaluate", "--live-endless", "moves", "--out", out, "--part-seconds", "30",
                  "--rate", "8", "--frames", "60", "--seed", "5", "--parts", parts});
  };
  const RunResult first = run("1");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, StartsWith("1 parts, 240 frames"));
  EXPECT_THAT(first.out, HasSubstr("in while out 0; false moved_sensor frames 0"));
  EXPECT_THAT(first.out, HasSubstr("a step of ")) << "it was in, and then was not";
  const fs::path part = out / "moves-structured_light-5.json";
  const auto made = fs::last_write_time(part);
  const RunResult again = run("1");
  EXPECT_EQ(again.out, first.out);
  EXPECT_EQ(fs::last_write_time(part), made) << "not made again";
  for (const auto& entry : fs::recursive_directory_iterator(out))
    EXPECT_EQ(entry.path(), part) << "no images";
}

TEST_F(MonitorTest, BadInputLeavesNothingBehind) {
  const RunResult result = Plumb(
      {"monitor", Recording(), "--scene", folder_ / "nothing", "--out", folder_ / "monitoring"});
  EXPECT_EQ(result.exit_code, 3);
  EXPECT_THAT(LeftBehind({}), IsEmpty());
}

}  // namespace
}  // namespace plumb
