// SPDX-License-Identifier: Apache-2.0
// web/openapi.yaml and the page's own limits against the server's.
#include <gmock/gmock.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <set>

#include "algo/planning/ct_skin.hpp"
#include "algo/types/planning_source.hpp"
#include "algo/verdict/default_tolerance.hpp"
#include "tests/unit/web/web_fixture.hpp"
#include "web/model/limits.hpp"
#include "web/model/scan.hpp"
#include "web/security/password_rules.hpp"

namespace plumb::test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// "GET /path permission" of every operation. The file is parsed by its indentation
/// alone: paths by two, methods by four, the rest deeper.
std::set<std::string> DocumentedOperations() {
  std::ifstream in(PLUMB_SOURCE_DIR "/web/openapi.yaml");
  std::set<std::string> operations;
  std::string line, path, method;
  bool in_paths = false;
  while (std::getline(in, line)) {
    if (!line.empty() && line[0] != ' ' && line[0] != '#') in_paths = line == "paths:";
    if (!in_paths) continue;
    if (line.starts_with("  /")) path = line.substr(2, line.find(':') - 2);
    if (line.starts_with("    ") && line.size() > 4 && line[4] != ' ') {
      method = line.substr(4, line.find(':') - 4);
      std::transform(method.begin(), method.end(), method.begin(),
                     [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    }
    const std::string key = "      x-permission: ";
    if (line.starts_with(key))
      operations.insert(method + " " + path + " " + line.substr(key.size()));
  }
  return operations;
}

class DocumentationTest : public WebTest {};

TEST_F(DocumentationTest, OpenApiListsExactlyWhatTheServerAnswers) {
  Start();
  std::set<std::string> answered;
  for (const web::Route& route : server_->routes())
    answered.insert(route.Name() + " " + std::string(web::Name(route.permission)));
  EXPECT_EQ(DocumentedOperations(), answered);
}

std::string TextOf(const std::string& file);

/// The keys of messages anywhere in it.
void AddMessageKeys(const nlohmann::json& json, std::set<std::string>& keys) {
  for (const auto& [key, value] : json.items()) {
    if (json.is_object() && (key.ends_with("_message") || key.ends_with("_messages")))
      keys.insert(key);
    if (value.is_structured()) AddMessageKeys(value, keys);
  }
}

TEST_F(DocumentationTest, OpenApiNamesTheMessagesBesideTheSentences) {
  Start();
  SetUpAccounts();
  HttpClient technician = LoggedIn("technician");
  std::set<std::string> keys;
  for (const char* path : {"/api/v1/status", "/api/v1/update", "/api/v1/room-calibration",
                           "/api/v1/sensor-profile", "/api/v1/nothing"})
    AddMessageKeys(technician.Get(path).json(), keys);
  EXPECT_THAT(keys, ::testing::IsSupersetOf({"fault_message", "warning_messages", "due_message",
                                             "why_none_message", "error_message"}));
  const std::string api = TextOf("/web/openapi.yaml");
  for (const std::string& key : keys) EXPECT_THAT(api, HasSubstr(key));
}

std::string TextOf(const std::string& file) {
  std::ifstream in(PLUMB_SOURCE_DIR + file);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The numbers that a file states as "NAME: {..., KEY: number, ...}" or "NAME = {...}".
std::set<double> Stated(const std::string& text, const std::string& name, const std::string& key) {
  const std::regex place("\\b" + name + "(: | = )\\{[^}]*\\b" + key + ": (-?[0-9.]+)");
  std::set<double> numbers;
  for (std::sregex_iterator at(text.begin(), text.end(), place), end; at != end; ++at)
    numbers.insert(std::stod((*at)[2]));
  return numbers;
}

TEST(LimitsTest, ThePageAndTheDescriptionStateTheLimitsOfTheServer) {
  EXPECT_EQ(kStatedSurface_mm.entered.most, kMostStated_m * 1e3) << "that of the command line";
  const std::string page = TextOf("/web/page/limits.js"), api = TextOf("/web/openapi.yaml");
  for (const auto& [name, limits] : {std::pair{"shift_tolerance_mm", kShiftTolerance_mm},
                                     {"rotation_tolerance_deg", kRotationTolerance_deg},
                                     {"clothing_mm", kStatedSurface_mm},
                                     {"ct_breathing_mm", kStatedSurface_mm},
                                     {"auto_stop_s", kAutoStop_s},
                                     {"scan_limit_s", kScanLimit_s},
                                     {"retention_days", kRetention_days},
                                     {"breath_window_mm", kBreathWindow_mm},
                                     {"idle_logout_min", kIdleLogout_min}}) {
    const auto [least, most] = limits.entered;
    EXPECT_THAT(Stated(page, name, "min"), ElementsAre(least)) << name;
    EXPECT_THAT(Stated(page, name, "max"), ElementsAre(most)) << name;
    EXPECT_THAT(Stated(api, name, "minimum"), ElementsAre(least)) << name;
    EXPECT_THAT(Stated(api, name, "maximum"), ElementsAre(most)) << name;
    EXPECT_TRUE(limits.stored.Holds(least) && limits.stored.Holds(most)) << name;
  }
  for (const auto& [of_page, of_api, most] : {std::tuple{"kName", "name", kMaxName},
                                              {"kSite", "site", kMaxSite},
                                              {"kNote", "note", kMaxNote},
                                              {"kReason", "reason", kMaxReason},
                                              {"kPassword", "password", web::kMaxPassword},
                                              {"kNewPassword", "password", web::kMaxPassword}}) {
    EXPECT_THAT(Stated(page, of_page, "maxlength"), ElementsAre(most)) << of_page;
    EXPECT_THAT(Stated(api, of_api, "maxLength"), ElementsAre(most)) << of_api;
  }
  EXPECT_THAT(Stated(page, "kThreshold", "min"), ElementsAre(kMinSkinThreshold_hu));
  EXPECT_THAT(Stated(page, "kThreshold", "max"), ElementsAre(kMaxSkinThreshold_hu));
  EXPECT_THAT(Stated(page, "kThreshold", "value"), ElementsAre(kSkinThreshold_hu));
  EXPECT_THAT(Stated(page, "kResult", "valid_s"), ElementsAre(kResultValid_s));
  EXPECT_THAT(Stated(page, "kTolerance", "shift_mm"), ElementsAre(kDefaultShiftTolerance_mm));
  EXPECT_THAT(Stated(page, "kTolerance", "rotation_deg"),
              ElementsAre(kDefaultRotationTolerance_deg));
  EXPECT_THAT(Stated(page, "kDrawing", "points"), ElementsAre(kMaxDrawnPoints));
  EXPECT_THAT(Stated(page, "kReason", "minlength"), ElementsAre(kMinReason));
  EXPECT_THAT(Stated(api, "reason", "minLength"), ElementsAre(kMinReason));
  EXPECT_THAT(Stated(page, "kNewPassword", "minlength"), ElementsAre(web::kMinPassword));
  EXPECT_THAT(Stated(api, "password", "minLength"), ElementsAre(web::kMinPassword));
}

TEST(LimitsTest, ThePageOffersThePosturesOfTheServer) {
  const std::string page = TextOf("/web/words/en.json");
  std::string listed;
  for (const std::string_view posture : kPostures) {
    EXPECT_THAT(page, HasSubstr("\"" + std::string(posture) + "\": \""));
    listed += (listed.empty() ? "" : ", ") + std::string(posture);
  }
  EXPECT_THAT(TextOf("/web/openapi.yaml"), HasSubstr("posture: {type: string, enum: [" + listed));
}

}  // namespace
}  // namespace plumb::test
