// SPDX-License-Identifier: Apache-2.0
// The room's calibration, from three scans of the board to the axes of a comparison: a real plumbd,
// whose simulated room has a board at a known place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/correction.hpp"
#include "drivers/simulator/suites/board_scenes.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using test::HttpClient;
using test::kPassword;
using ::testing::HasSubstr;
using testing::Plumbd;

/// Of the reference marker's frame, from the simulator's plan.
Pose TrueRoom() {
  SimulateOptions options;
  options.frames = 120;
  options.rate_hz = 30;
  options.width = 320;
  options.height = 240;
  const simulated::SuitePlan plan = simulated::PlanSuite(options);
  return simulated::CalibrationBoardPose().inverse() * plan.room.boards.front().T_world_marker;
}

Pose PoseOf(const json& rows) {
  Pose T = Pose::Identity();
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) T.matrix()(r, c) = rows[r][c].get<double>();
  }
  return T;
}

class DaemonRoomTest : public ::testing::Test {
 protected:
  void SetUp() override {
    plumbd_ = std::make_unique<Plumbd>(
        folder_.path(), testing::PlumbdOptions{.arguments = {"--sim-board"}, .scenes = 5});
    for (int i = 0; i < 10 && !plumbd_->WaitUntilUp(); ++i) {
    }
    plumbd_->WaitForState("ready");
    const std::uint16_t port = plumbd_->port();
    engineer_ = std::make_unique<HttpClient>(plumbd_->MakeFirstAccount());
    physicist_ = std::make_unique<HttpClient>(port);
    ASSERT_TRUE(test::AddAccount(port, *engineer_, "physicist", "physicist"));
    ASSERT_EQ(physicist_->LogIn("physicist", kPassword), 200);
  }

  [[nodiscard]] json Room() { return physicist_->Get("/api/v1/room-calibration").json(); }
  int Sign(const std::string& digest) {
    return physicist_
        ->Post("/api/v1/room-calibration/sign", {{"digest", digest}, {"password", kPassword}})
        .status;
  }

  testing::TempFolder folder_;
  std::unique_ptr<Plumbd> plumbd_;
  std::unique_ptr<HttpClient> engineer_, physicist_;
};

TEST_F(DaemonRoomTest, ThreeScansOfTheBoardGiveComparisonsTheRoomsAxes) {
  EXPECT_EQ(physicist_->Get("/api/v1/room-calibration/board.pdf").body.substr(0, 5), "%PDF-");
  EXPECT_THAT(Room()["why_not_sign"].get<std::string>(), HasSubstr("not been scanned"));
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(engineer_->Post("/api/v1/checks/open").status, 200);
    plumbd_->ScanOnce();
    ASSERT_EQ(plumbd_->Sim("next-scene")["ok"], true);
    ASSERT_EQ(Room()["scans"].size(), static_cast<std::size_t>(i + 1)) << Room().dump(1);
  }
  const json candidate = Room();
  std::printf("three scans differ by %.2f mm, %.3f deg\n", candidate["shift_mm"].get<double>(),
              candidate["turn_deg"].get<double>());
  for (const json& scan : candidate["scans"]) std::printf("  %s\n", scan.dump().c_str());
  ASSERT_EQ(candidate["why_not_sign"], "");
  EXPECT_EQ(Sign(std::string(64, '0')), 409);
  ASSERT_EQ(Sign(candidate["digest"]), 201);
  EXPECT_EQ(Room()["versions"][0]["version"], 1);
  EXPECT_EQ(Room()["versions"][0]["signed_by"], "physicist");
  EXPECT_EQ(Room()["due"], "");

  // What the page draws is turned as the board was.
  const json status = physicist_->Get("/api/v1/status").json();
  const Pose T_true = TrueRoom();
  EXPECT_TRUE(status["room"]["known"].get<bool>());
  EXPECT_NEAR(status["room"]["gantry_xy"][0].get<double>(), T_true(1, 0), 0.02);
  EXPECT_NEAR(status["room"]["gantry_xy"][1].get<double>(), T_true(1, 1), 0.02);

  // The demo's own session: its first scan becomes the approved reference.
  plumbd_->ScanOnce();
  ASSERT_EQ(plumbd_->Sim("next-scene")["ok"], true);
  const std::string fraction = plumbd_->ScanOnce()["last_result"]["scan"];
  const json result = physicist_->Get("/api/v1/results/" + fraction).json();
  EXPECT_EQ(result["room_calibration"],
            (json{{"version", 1}, {"used", true}, {"why_not_used", ""}}));
  // The six numbers are those of this very motion in the board's true axes, not in the axes that
  // the demo assumes, which lie 12 deg off.
  const json& c = result["motion"]["centroid_m"];
  const Vector6d couch =
      CouchVector(PoseOf(result["motion"]["T"]), Eigen::Vector3d(c[0], c[1], c[2]), T_true);
  const Vector6d assumed = [&] {
    Pose T = Pose::Identity();
    T.linear() << 0, 1, 0, -1, 0, 0, 0, 0, 1;
    return CouchVector(PoseOf(result["motion"]["T"]), Eigen::Vector3d(c[0], c[1], c[2]), T);
  }();
  const json& numbers = result["correction"];
  EXPECT_NEAR(numbers["lateral_mm"].get<double>(), couch(0) / kMillimetre, 1.0);
  EXPECT_NEAR(numbers["longitudinal_mm"].get<double>(), couch(1) / kMillimetre, 1.0);
  EXPECT_NEAR(numbers["vertical_mm"].get<double>(), couch(2) / kMillimetre, 1.0);
  EXPECT_GT((assumed - couch).head<2>().norm(), 3 * kMillimetre) << "else nothing was shown";
}

}  // namespace
}  // namespace plumb
