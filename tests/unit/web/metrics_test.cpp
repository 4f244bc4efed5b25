// SPDX-License-Identifier: Apache-2.0
#include "web/api/watching/metrics.hpp"

#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/web/web_fixture.hpp"

namespace plumb::web {
namespace {

using testing::HasSubstr;
using testing::Not;

Status SomeStatus(WallClock::time_point now) {
  Status status;
  status.state = ApplianceState::kReady;
  status.version = "1.2 \"x\"\n";
  status.sensor.present = true;
  status.sensor.frames_per_second = 29.97;
  status.sensor.powered_s = 60;
  status.storage = {.free_bytes = 1'000'000'000'001, .total_bytes = 2'000'000'000'000};
  status.storage.backup_made_at = now - std::chrono::hours(2);
  status.daily_check = DailyCheck::kFailed;
  CheckItem scale, moved;
  scale.name = "scale", scale.value = -0.006, scale.limit = 0.004;
  moved.name = "moved", moved.limit = 0.004;
  status.last_check.emplace();
  status.last_check->time = now - std::chrono::minutes(5);
  status.last_check->items = {scale, moved};
  status.counts.verdicts[static_cast<std::size_t>(Verdict::kMove)] = 3;
  status.counts.failed = 1;
  status.counts.frames = 450;
  status.counts.frames_dropped = 7;
  status.counts.answer_s = 1.25;
  status.messages = {{.name = "mail", .sent = 4, .failed = 1, .failure = Message::Verbatim("no")}};
  return status;
}

std::string SomeMetrics() {
  const auto now = WallClock::now();
  Health health;
  health.ok = false;
  return MetricsText(SomeStatus(now), health, now);
}

void AddNames(const std::string& text, const std::string& pattern, std::set<std::string>& to) {
  const std::regex expression(pattern);
  for (auto at = std::sregex_iterator(text.begin(), text.end(), expression);
       at != std::sregex_iterator(); ++at)
    to.insert((*at)[1]);
}

TEST(Metrics, SayWhatTheStatusSays) {
  const std::string text = SomeMetrics();
  for (const char* line :
       {"plumb_healthy 0\n", "plumb_state{plumb_state=\"ready\"} 1\n",
        "plumb_state{plumb_state=\"scanning\"} 0\n", "plumb_sensor_frame_rate_hertz 29.97\n",
        "plumb_storage_free_bytes 1000000000001\n", "plumb_backup_age_seconds 7200\n",
        "plumb_daily_check{plumb_daily_check=\"failed\"} 1\n",
        "plumb_daily_check{plumb_daily_check=\"passed\"} 0\n", "plumb_check_age_seconds 300\n",
        "plumb_check_limit_ratio{item=\"scale\"} 1.5\n", "plumb_scans_total{outcome=\"move\"} 3\n",
        "plumb_scans_total{outcome=\"failed\"} 1\n", "plumb_frames_total 450\n",
        "plumb_frames_dropped_total 7\n", "plumb_answer_seconds 1.25\n",
        "plumb_messages_total{way=\"mail\",outcome=\"sent\"} 4\n",
        "plumb_messages_total{way=\"mail\",outcome=\"failed\"} 1\n",
        "plumb_messages_failing{way=\"mail\"} 1\n",
        "plumb_build_info{version=\"1.2 \\\"x\\\" \"} 1\n"})
    EXPECT_THAT(text, HasSubstr(line));
  EXPECT_THAT(text, Not(HasSubstr("\"moved\""))) << "what was not measured is not 0";
  const auto now = WallClock::now();
  EXPECT_THAT(MetricsText({}, {}, now), Not(HasSubstr("backup_age")));
  EXPECT_THAT(MetricsText({}, {}, now), HasSubstr("plumb_healthy 1\n"));
}

// Of OpenMetrics 1.0: one family after the other, each with its type before its samples; a unit is
// the end of the family's name; counters end in _total, information in _info; the text ends so.
TEST(Metrics, AreOpenMetrics) {
  const std::string text = SomeMetrics();
  EXPECT_TRUE(text.ends_with("\n# EOF\n"));
  std::istringstream lines(text);
  std::string family, type;
  std::set<std::string> families, samples;
  const std::regex type_line("# TYPE (plumb_[a-z_]+) (gauge|counter|info|stateset)");
  const std::regex unit_line("# UNIT (plumb_[a-z_]+) ([a-z]+)");
  const std::regex help_line("# HELP (plumb_[a-z_]+) [^\\\\\"]+\\.");
  const std::regex sample_line(
      R"re((plumb_[a-z_]+)(\{(?:,?[a-z_]+="(?:[^"\\]|\\["\\])*")+\})? (-?[0-9.]+(?:e[-+][0-9]+)?))re");
  std::smatch found;
  for (std::string line; std::getline(lines, line) && line != "# EOF";) {
    if (std::regex_match(line, found, type_line)) {
      family = found[1], type = found[2];
      EXPECT_TRUE(families.insert(family).second) << family << " twice";
    } else if (std::regex_match(line, found, unit_line)) {
      EXPECT_EQ(found[1], family);
      EXPECT_TRUE(family.ends_with("_" + found[2].str())) << line;
    } else if (std::regex_match(line, found, help_line)) {
      EXPECT_EQ(found[1], family);
    } else {
      ASSERT_TRUE(std::regex_match(line, found, sample_line)) << line;
      EXPECT_EQ(found[1], family + (type == "counter" ? "_total" : type == "info" ? "_info" : ""));
      EXPECT_TRUE(samples.insert(found[1].str() + found[2].str()).second) << line << " twice";
    }
  }
  EXPECT_GT(families.size(), 15U);
}

TEST(Metrics, AlertsAndDashboardAskForWhatThereIs) {
  std::set<std::string> given, asked;
  AddNames(SomeMetrics(), "\n(plumb_[a-z_]+)[{ ]", given);
  for (const char* name : {"plumb-alerts.yml", "plumb-dashboard.json"}) {
    std::ifstream file(std::filesystem::path(PLUMB_SOURCE_DIR) / "docs" / "watching" / name);
    ASSERT_TRUE(file) << name;
    const std::size_t before = asked.size();
    AddNames({std::istreambuf_iterator<char>(file), {}}, "\\b(plumb_[a-z_]+)\\b", asked);
    EXPECT_GT(asked.size(), before) << name;
  }
  for (const std::string& name : asked) EXPECT_TRUE(given.contains(name)) << name;
}

class MetricsPage : public test::WebTest {};

TEST_F(MetricsPage, IsForWhoeverKnowsTheToken) {
  const std::string token(40, 'x');
  Start([&](HttpServerOptions& options) { options.metrics_token = token; });
  const auto get = [&](const std::map<std::string, std::string>& headers) {
    test::HttpClient client(port_);
    client.extra_headers = headers;
    return client.Get("/metrics");
  };
  EXPECT_EQ(get({}).status, 401);
  EXPECT_EQ(get({{"Authorization", "Bearer " + token.substr(1)}}).status, 401);
  EXPECT_EQ(get({{"Authorization", "Bearer " + token + "x"}}).status, 401);
  EXPECT_EQ(get({{"Authorization", "Basic " + token}}).status, 401);
  const auto answer = get({{"Authorization", "Bearer " + token}});
  EXPECT_EQ(answer.status, 200);
  EXPECT_THAT(answer.body, HasSubstr("plumb_healthy 1\n"));
}

TEST_F(MetricsPage, DoesNotExistWithoutAToken) {
  Start();
  test::HttpClient client(port_);
  client.extra_headers = {{"Authorization", "Bearer "}};
  EXPECT_EQ(client.Get("/metrics").status, 404);
}

}  // namespace
}  // namespace plumb::web
