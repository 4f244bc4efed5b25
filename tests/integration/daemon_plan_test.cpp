// SPDX-License-Identifier: Apache-2.0
// The approved plan of a reference, from the page to the verdict of a live scan: a real plumbd.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using test::HttpClient;
using test::kPassword;
using ::testing::HasSubstr;
using testing::Plumbd;

class DaemonPlanTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  void SetUp() override {
    plumbd_ = std::make_unique<Plumbd>(folder_.path(), testing::PlumbdOptions{.scenes = 2});
    ASSERT_TRUE(plumbd_->WaitUntilUp());
    plumbd_->WaitForState("ready");
    const std::uint16_t port = plumbd_->port();
    planner_ = std::make_unique<HttpClient>(port);
    approver_ = std::make_unique<HttpClient>(port);
    HttpClient engineer = plumbd_->MakeFirstAccount();
    for (const char* name : {"planner", "approver"})
      ASSERT_TRUE(test::AddAccount(port, engineer, name, "physicist")) << name;
    ASSERT_EQ(planner_->LogIn("planner", kPassword), 200);
    ASSERT_EQ(approver_->LogIn("approver", kPassword), 200);
    const json demo = planner_->Get("/api/v1/status").json()["session"];
    ASSERT_EQ(planner_->Post("/api/v1/treatment/close", {{"session_id", demo["id"]}}).status, 200);
    patient_ = planner_->Post("/api/v1/patients", {{"code", "P-1"}, {"site", "thorax"}})
                   .json()
                   .value("id", "");
    Open("reference");
    plumbd_->ScanOnce();
    const json waiting = planner_->Get("/api/v1/status").json()["waiting"];
    ASSERT_EQ(waiting.size(), 1U);
    reference_ = waiting[0]["reference_id"];
    ASSERT_EQ(plumbd_->Sim("next-scene")["ok"], true);
    Open("fraction", 409);  // nothing is approved yet
  }

  void Open(const std::string& purpose, int expected = 200) {
    EXPECT_EQ(
        planner_
            ->Post("/api/v1/patients/" + patient_ + "/open", {{"purpose", purpose}, {"reason", ""}})
            .status,
        expected);
  }
  /// Plans, has another person approve it, scans, and gives result.json.
  json ScanBy(json plan) {
    const std::string path = "/api/v1/references/";
    plan["revision"] = planner_->Get(path + reference_).json()["revision"];
    const auto planned = planner_->Put(path + reference_ + "/plan", plan);
    EXPECT_LE(planned.status, 201) << planned.body;
    reference_ = planned.json().value("id", reference_);  // of an approved one: the next version
    const json draft = approver_->Get(path + reference_).json();
    EXPECT_EQ(approver_
                  ->Post(path + reference_ + "/approve", {{"revision", draft["revision"]},
                                                          {"digest", draft["digest"]},
                                                          {"reason", "there is no check here"},
                                                          {"password", kPassword}})
                  .status,
              200);
    Open("fraction");
    const std::string scan = plumbd_->ScanOnce()["last_result"]["scan"];
    const json result = planner_->Get("/api/v1/results/" + scan).json();
    // An open session would keep the version that it was opened with.
    const json session = planner_->Get("/api/v1/status").json()["session"];
    EXPECT_EQ(planner_->Post("/api/v1/treatment/close", {{"session_id", session["id"]}}).status,
              200);
    RecordProperty("result", result.value("reasons", json::array()).dump());
    return result;
  }

  /// The demo's body lies 39 mm beside and 27 mm along from where it was, turned by 3.3 degrees.
  const json wide_ = {{"region_m", json::array()}, {"isocentre_m", {0.60, 0.25, 0.11}},
                      {"shift_tolerance_mm", 50},  {"rotation_tolerance_deg", 6},
                      {"posture", "HFS"},          {"couch_markers", false}};
  testing::TempFolder folder_;
  std::unique_ptr<Plumbd> plumbd_;
  std::unique_ptr<HttpClient> planner_, approver_;
  std::string patient_, reference_;
};

TEST_F(DaemonPlanTest, ToleranceAndPostureThatWereApprovedAreUsed) {
  const json within = ScanBy(wide_);
  EXPECT_EQ(within["verdict"], "in_tolerance") << within["reasons"].dump();
  EXPECT_EQ(within["correction"]["isocentre"], (json{0.60, 0.25, 0.11}));
  json narrow = wide_;
  narrow["shift_tolerance_mm"] = 20;
  const json outside = ScanBy(narrow);
  EXPECT_EQ(outside["verdict"], "move") << "the same scan by a narrower tolerance";
  EXPECT_THAT(outside["reasons"].dump(), HasSubstr("20 mm"));
  json turned = wide_;
  turned["rotation_tolerance_deg"] = 2;
  turned["posture"] = "HFP";
  const json prone = ScanBy(turned);
  EXPECT_EQ(prone["verdict"], "move") << "and by a narrower one of rotations";
  for (const json* result : {&within, &prone})
    ASSERT_EQ((*result)["body"]["named_by"], "posture") << (*result)["body"].dump();
  const json &supine_left = within["body"]["left_xy"], &prone_left = prone["body"]["left_xy"];
  EXPECT_LT(supine_left[0].get<double>() * prone_left[0].get<double>() +
                supine_left[1].get<double>() * prone_left[1].get<double>(),
            -0.9)
      << "who lies on the belly has the left side where it was the right one";
}

// The body's skin is about 0.2 m above the reference marker's plane here.
TEST_F(DaemonPlanTest, AnIsocentreFarFromEverythingIsNotSigned) {
  const std::string path = "/api/v1/references/" + reference_;
  const auto sign = [&](const json& isocentre_m) {
    json plan = wide_;
    plan["isocentre_m"] = isocentre_m;
    plan["revision"] = planner_->Get(path).json()["revision"];
    EXPECT_EQ(planner_->Put(path + "/plan", plan).status, 200);
    const json draft = approver_->Get(path).json();
    return approver_->Post(path + "/approve", {{"revision", draft["revision"]},
                                               {"digest", draft["digest"]},
                                               {"reason", "there is no check here"},
                                               {"password", kPassword}});
  };
  for (const json& far : {json{44, 48, 12}, json{0.60, 0.25, 0.80}, json{0.60, 0.25, -0.80}}) {
    const HttpAnswer refused = sign(far);
    EXPECT_EQ(refused.status, 409) << far;
    EXPECT_EQ(refused.json()["error_message"]["id"], "store.reference_isocentre") << far;
  }
  EXPECT_EQ(sign({0.60, 0.25, 0.55}).status, 200) << "asked about on the page, and signed";
}

TEST_F(DaemonPlanTest, RegionAndCouchMarkersThatWereApprovedAreUsed) {
  json plan = wide_;
  plan["region_m"] = {{0.50, 0.15}, {0.80, 0.15}, {0.80, 0.55}, {0.50, 0.55}};
  plan["couch_markers"] = true;
  const json result = ScanBy(plan);
  ASSERT_TRUE(result["motion"].is_object()) << result["reasons"].dump();
  EXPECT_GT(result["motion"]["centroid_m"][0].get<double>(), 0.5) << "of the drawn region";
  EXPECT_TRUE(result["correction"]["vertical_mm"].is_null()) << "couch markers: no shifts";
  EXPECT_TRUE(result["correction"]["lateral_mm"].is_null());
  EXPECT_NE(result["verdict"], "move") << result["reasons"].dump();
}

}  // namespace
}  // namespace plumb
