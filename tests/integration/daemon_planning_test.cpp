// SPDX-License-Identifier: Apache-2.0
// The planning CT as reference, from its upload to six numbers: a real plumbd, whose simulated room
// has a board at a known place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/correction.hpp"
#include "drivers/simulator/suites/board_scenes.hpp"
#include "drivers/simulator/suites/ct_images.hpp"
#include "drivers/simulator/suites/dicom_writer.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "tests/integration/dicomd.hpp"
#include "tests/support/calibrate_room.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "web/model/reference.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using simulated::CtQuirk;
using test::HttpClient;
using test::kPassword;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::Plumbd;

/// The room and the body of the virtual sensor's first scene after those of the board.
simulated::SuitePlan DemoPlan() {
  SimulateOptions options;
  options.frames = 120;
  options.rate_hz = 30;
  options.width = 320;
  options.height = 240;
  return simulated::PlanSuite(options);
}

const Pose kIecWorld = simulated::CalibrationBoardPose().inverse();

class DaemonPlanningTest : public ::testing::Test {
 protected:
  void SetUp() override {
    dicomd_ = std::make_unique<testing::Dicomd>(folder_.path());
    plumbd_ = std::make_unique<Plumbd>(
        folder_.path(),
        testing::PlumbdOptions{.arguments = {"--sim-board", "--config", dicomd_->config().string()},
                               .scenes = 5});
    for (int i = 0; i < 10 && !plumbd_->WaitUntilUp(); ++i) {
    }
    plumbd_->WaitForState("ready");
    const std::uint16_t port = plumbd_->port();
    engineer_ = std::make_unique<HttpClient>(plumbd_->MakeFirstAccount());
    for (const char* name : {"planner", "approver"})
      ASSERT_TRUE(test::AddAccount(port, *engineer_, name, "physicist")) << name;
    planner_ = std::make_unique<HttpClient>(port);
    approver_ = std::make_unique<HttpClient>(port);
    ASSERT_EQ(planner_->LogIn("planner", kPassword), 200);
    ASSERT_EQ(approver_->LogIn("approver", kPassword), 200);
    const json demo = planner_->Get("/api/v1/status").json()["session"];
    ASSERT_EQ(planner_->Post("/api/v1/treatment/close", {{"session_id", demo["id"]}}).status, 200);
    patient_ = planner_->Post("/api/v1/patients", {{"code", "CT-1"}, {"site", "thorax"}})
                   .json()
                   .value("id", "");
  }

  /// The body lies in the plan 4 mm to the side, 3 mm along and 2 mm above where the sweep finds
  /// it.
  [[nodiscard]] static Pose PlannedBody(const simulated::ScenePlan& scene) {
    Pose T = kIecWorld * scene.T_world_body;
    T.pretranslate(Eigen::Vector3d(0.004, 0.003, 0.002));
    return T;
  }

  /// @param patient_id  In the files; empty: as simulated.
  /// @param form  More of what is said of the files.
  test::HttpAnswer Upload(const simulated::PlanningCtOptions& options,
                          const std::string& patient_id = {}, const std::string& form = {}) {
    const simulated::SuitePlan demo = DemoPlan();
    auto [structures, plan] = simulated::MakePlanningCt(demo.scenes.front().body->surface,
                                                        PlannedBody(demo.scenes.front()), options);
    if (!patient_id.empty()) structures.file.patient_id = plan.file.patient_id = patient_id;
    const std::string first = DicomBytes(structures);
    HttpClient sender = *planner_;
    sender.extra_headers["Content-Type"] = "application/octet-stream";
    sender.extra_headers["X-Plumb-Planning"] =
        "structures_bytes=" + std::to_string(first.size()) + form;
    return sender.Ask("POST", "/api/v1/patients/" + patient_ + "/planning",
                      first + DicomBytes(plan));
  }

  void CalibrateRoom() { testing::CalibrateRoom(*plumbd_, *engineer_, *planner_); }

  json SceneOf(const std::string& reference) {
    const json draft = planner_->Get("/api/v1/references/" + reference).json();
    return planner_
        ->Get("/api/v1/scans/" + draft["scan_id"].get<std::string>() + "/files/scene.json")
        .json();
  }
  /// Plans the draft as it is, and has another person approve it.
  /// @param skin_of_images  It must be confirmed that this is the body's.
  /// @param stated  Of its surface.
  void Approve(const std::string& reference, bool skin_of_images = false,
               const ReferencePlan& stated = {}) {
    const std::string path = "/api/v1/references/" + reference;
    const json draft = planner_->Get(path).json();
    json plan = {
        {"region_m", json::array()},    {"isocentre_m", {0, 0, 0}}, {"shift_tolerance_mm", 3.5},
        {"rotation_tolerance_deg", 1},  {"posture", "HFP"},         {"couch_markers", false},
        {"revision", draft["revision"]}};
    EXPECT_EQ(planner_->Put(path + "/plan", plan).status, 400) << "the file says HFS";
    plan["posture"] = "HFS";
    plan["isocentre_m"] = {0.001, 0, 0};
    EXPECT_EQ(planner_->Put(path + "/plan", plan).status, 400) << "the isocentre is the plan's";
    plan["isocentre_m"] = {0, 0, 0};
    plan["clothing_mm"] = 30.1;
    EXPECT_EQ(planner_->Put(path + "/plan", plan).status, 400) << "no clothing is so thick";
    plan["clothing_mm"] = stated.clothing_mm;
    plan["ct_breathing_mm"] = stated.ct_breathing_mm;
    ASSERT_EQ(planner_->Put(path + "/plan", plan).status, 200);
    const json planned = approver_->Get(path).json();
    EXPECT_EQ(planned["room"]["gantry_xy"], (json{0.0, 1.0})) << planned.dump();
    EXPECT_FALSE(planned["room"].contains("contradicts_posture")) << "nor a CT wider than long";
    json approval = {
        {"revision", planned["revision"]}, {"digest", planned["digest"]}, {"password", kPassword}};
    if (skin_of_images) {
      for (const json& said : {json(), json(false)}) {
        json without = approval;
        if (!said.is_null()) without["images_confirmed"] = said;
        const auto refused = approver_->Post(path + "/approve", without);
        EXPECT_EQ(refused.status, 409) << refused.body;
        EXPECT_EQ(refused.json()["error_message"]["id"], "store.reference_images");
      }
      approval["images_confirmed"] = true;
    }
    const auto approved = approver_->Post(path + "/approve", approval);
    ASSERT_EQ(approved.status, 200) << approved.body;
  }

  [[nodiscard]] json OpenSession() {
    EXPECT_EQ(planner_
                  ->Post("/api/v1/patients/" + patient_ + "/open",
                         {{"purpose", "fraction"}, {"reason", ""}})
                  .status,
              200);
    return planner_->Get("/api/v1/status").json()["session"];
  }

  /// Plans and approves a surface captured from that scan. Returns the id.
  std::string Capture(const std::string& scan) {
    const std::string path =
        "/api/v1/references/" +
        planner_->Post("/api/v1/references", {{"scan_id", scan}, {"reason", "verified"}})
            .json()
            .value("id", "");
    const json draft = planner_->Get(path).json();
    EXPECT_EQ(draft["source"], "sweep");
    EXPECT_EQ(draft["plan"]["tolerance"]["shift_mm"], 3.5) << "as in the plan of the CT";
    EXPECT_EQ(draft["plan"]["clothing_mm"], 0) << "what the camera saw, not the CT";
    json covered = {
        {"region_m", json::array()},     {"isocentre_m", nullptr}, {"shift_tolerance_mm", 3},
        {"rotation_tolerance_deg", 1},   {"posture", "HFS"},       {"couch_markers", false},
        {"revision", draft["revision"]}, {"ct_breathing_mm", 1}};
    EXPECT_EQ(planner_->Put(path + "/plan", covered).json()["error_message"]["id"],
              "scan.surface_of_planning");
    EXPECT_EQ(planner_
                  ->Put(path + "/plan", {{"region_m", json::array()},
                                         {"isocentre_m", draft["room"]["lasers_m"]},
                                         {"shift_tolerance_mm", 3},
                                         {"rotation_tolerance_deg", 1},
                                         {"posture", "HFS"},
                                         {"couch_markers", false},
                                         {"revision", draft["revision"]}})
                  .status,
              200);
    const json planned = approver_->Get(path).json();
    const auto approved = approver_->Post(path + "/approve", {{"revision", planned["revision"]},
                                                              {"digest", planned["digest"]},
                                                              {"reason", "looked at it"},
                                                              {"password", kPassword}});
    EXPECT_EQ(approved.status, 200) << approved.body;
    return draft["id"];
  }

  /// Opens a session, chooses that reference for it, and sweeps once.
  json ScanAgainst(const std::string& reference) {
    const std::string session = OpenSession()["id"];
    const auto chosen = planner_->Post("/api/v1/treatment/reference",
                                       {{"session_id", session}, {"reference_id", reference}});
    EXPECT_EQ(chosen.status, 200) << chosen.body;
    const std::string scan = plumbd_->ScanOnce()["last_result"]["scan"];
    EXPECT_EQ(planner_->Get("/api/v1/scans/" + scan).json()["reference_id"], reference);
    EXPECT_EQ(planner_->Post("/api/v1/treatment/close", {{"session_id", session}}).status, 200);
    return planner_->Get("/api/v1/results/" + scan).json();
  }

  /// @param said_of_it  What the scan's quality must say of the reference.
  json ScanFraction(const std::string& said_of_it = "BODY") {
    const json opened = OpenSession();
    EXPECT_EQ(opened["reference"]["source"], "planning_ct");
    const std::string scan = plumbd_->ScanOnce()["last_result"]["scan"];
    const json session = planner_->Get("/api/v1/status").json()["session"];
    EXPECT_EQ(planner_->Post("/api/v1/treatment/close", {{"session_id", session["id"]}}).status,
              200);
    EXPECT_THAT(planner_->Get("/api/v1/scans/" + scan + "/quality").body, HasSubstr(said_of_it));
    return planner_->Get("/api/v1/results/" + scan).json();
  }

  /// What the couch has to do after PlannedBody().
  [[nodiscard]] static Vector6d TrueCouch() {
    const simulated::SuitePlan demo = DemoPlan();
    const Pose T_motion =
        kIecWorld * demo.scenes.front().T_world_body * PlannedBody(demo.scenes.front()).inverse();
    return CouchVector(T_motion, Eigen::Vector3d::Zero(), Pose::Identity());
  }
  static void ExpectShifts(const json& numbers, const Vector6d& couch) {
    // Measured: 0.84, 0.45 and 0.48 mm off, at intervals of 2.1, 3.0 and 1.7 mm.
    EXPECT_NEAR(numbers["lateral_mm"].get<double>(), couch(0) / kMillimetre, 1.8);
    EXPECT_NEAR(numbers["longitudinal_mm"].get<double>(), couch(1) / kMillimetre, 1.8);
    EXPECT_NEAR(numbers["vertical_mm"].get<double>(), couch(2) / kMillimetre, 1.8);
  }

  testing::TempFolder folder_;
  std::unique_ptr<testing::Dicomd> dicomd_;
  std::unique_ptr<Plumbd> plumbd_;
  std::unique_ptr<HttpClient> engineer_, planner_, approver_;
  std::string patient_;
};

TEST_F(DaemonPlanningTest, FromTheUploadToSixNumbersInACalibratedRoom) {
  const auto refused = Upload({.quirks = {CtQuirk::kSeveralExternal}});
  EXPECT_EQ(refused.status, 400) << refused.body;
  EXPECT_EQ(refused.json()["error_message"]["id"], "planning.several_external") << refused.body;
  EXPECT_EQ(refused.body.find(folder_.path().string()), std::string::npos) << "a path of ours";
  EXPECT_EQ(Upload({.quirks = {CtQuirk::kOtherPatient}}).status, 400);
  const auto imported = Upload({});
  ASSERT_EQ(imported.status, 201) << imported.body;
  const std::string reference = imported.json()["id"];
  const json scene = SceneOf(reference);
  EXPECT_EQ(scene["planning"]["roi"], "BODY");
  EXPECT_EQ(scene["source"], "dicom");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.path()))
    EXPECT_NE(entry.path().extension(), ".dcm") << "the files name the patient";
  EXPECT_FALSE(scene["planning"].contains("skin_threshold_hu")) << "a contour has none";
  Approve(reference, /*skin_of_images=*/false, {.clothing_mm = 1, .ct_breathing_mm = 1.5});

  // The board lies there and no body: whatever is seen, the room is not calibrated.
  const json without = ScanFraction();
  EXPECT_EQ(without["verdict"], "no_answer") << without.dump().substr(0, 2000);
  EXPECT_EQ(without["compared_with"]["roi"], "BODY");

  CalibrateRoom();
  const json result = ScanFraction();
  EXPECT_EQ(result["compared_with"]["source"], "dicom");
  EXPECT_TRUE(result["room_calibration"]["used"].get<bool>());
  ASSERT_TRUE(result["correction"].is_object()) << result["reasons"].dump();
  const Vector6d couch = TrueCouch();
  ExpectShifts(result["correction"], couch);
  // What was stated and signed is in the intervals by its cause; without it 1.7 mm in height.
  EXPECT_EQ(result["compared_with"]["clothing_mm"], 1);
  EXPECT_EQ(result["compared_with"]["ct_breathing_mm"], 1.5);
  const json& parts = result["motion"]["covariance_parts"];
  EXPECT_NEAR(1960 * std::sqrt(parts["ct_breathing"][5][5].get<double>()), 1.5, 0.2)
      << parts.dump();
  EXPECT_GT(1960 * std::sqrt(parts["clothing"][5][5].get<double>()), 0.8);
  EXPECT_GT(result["correction"]["uncertainty"]["vertical_mm"].get<double>(), 2.1);

  // That position is captured. Each session compares with what was chosen for it.
  const std::string captured = Capture(planner_->Get("/api/v1/status").json()["last_result"]["id"]);
  const json opened = OpenSession();
  EXPECT_EQ(opened["reference"]["id"], captured) << "the newest, as long as nobody chooses";
  EXPECT_EQ(opened["other_reference"]["id"], reference);
  const json against_ct = ScanAgainst(reference);
  EXPECT_EQ(against_ct["compared_with"]["source"], "dicom");
  EXPECT_NEAR(against_ct["correction"]["lateral_mm"].get<double>(), couch(0) / kMillimetre, 1.8);
  const json log = engineer_->Get("/api/v1/audit").json()["entries"];
  const auto row = std::find_if(log.begin(), log.end(), [](const json& entry) {
    return entry["action"] == "session.reference";
  });
  ASSERT_NE(row, log.end());
  EXPECT_EQ((*row)["detail"], "version 1, planning CT");
  // The body lies where it lay when it was captured.
  const json against_surface = ScanAgainst(captured);
  EXPECT_FALSE(against_surface["compared_with"].is_object()) << against_surface.dump();
  EXPECT_NEAR(against_surface["correction"]["lateral_mm"].get<double>(), 0, 1.5);
  EXPECT_NEAR(against_surface["correction"]["vertical_mm"].get<double>(), 0, 1.5);
}

TEST_F(DaemonPlanningTest, FromReceivedImagesToSixNumbersInACalibratedRoom) {
  // The planning system sends a plan, a structure set without an external contour, and the images.
  const simulated::PlanningCtOptions options{.spacing_m = 5 * kMillimetre,
                                             .quirks = {CtQuirk::kShort, CtQuirk::kNoExternal}};
  const simulated::SuitePlan demo = DemoPlan();
  const auto [structures, plan] = simulated::MakePlanningCt(
      demo.scenes.front().body->surface, PlannedBody(demo.scenes.front()), options);
  std::vector<std::string> files = {DicomBytes(structures), DicomBytes(plan)};
  simulated::MakeCtImages(structures, options, {.pixel_mm = 2.4},
                          [&](const CtImage& image) { files.push_back(DicomBytes(image)); });
  dicomd_->Send(files);
  const json received = testing::Settled(
      *planner_, "/api/v1/planning/received",
      [](const json& found) { return found["files"].size() == 2 && found["unread"] == 0; });
  ASSERT_EQ(received["series"].size(), 1U) << received.dump();
  const json& series = received["series"][0];
  EXPECT_EQ(series["images"], files.size() - 2);
  const json& file = received["files"][received["files"][0]["kind"] == "plan" ? 0 : 1];
  EXPECT_EQ(file["has_skin"], false);
  EXPECT_EQ(file["series"], json({series["uid"]}));

  const auto import = [&](json body) {
    body["plan"] = file["name"];
    body["structures"] = file["structures"];
    return planner_->Post("/api/v1/patients/" + patient_ + "/planning/received", body);
  };
  EXPECT_THAT(import({}).json()["error_message"]["id"].get<std::string>(),
              HasSubstr("planning.no_external"))
      << "images are never taken by themselves";
  EXPECT_EQ(import({{"series", series["uid"]}}).status, 400) << "at which threshold?";
  EXPECT_EQ(import({{"series", series["uid"]}, {"threshold_hu", 1}}).status, 400);
  EXPECT_EQ(import({{"series", "2.25.404"}, {"threshold_hu", -300}}).status, 404);
  const json wanted = {{"series", series["uid"]}, {"threshold_hu", -350}};
  dicomd_->SetAge({});  // reading them may have taken longer than the pause
  const auto early = import(wanted);
  EXPECT_EQ(early.status, 409) << early.body;
  EXPECT_EQ(early.json()["error_message"]["id"], "scan.images_arriving") << early.body;
  dicomd_->SetAge(std::chrono::minutes(2));
  const auto imported = import(wanted);
  ASSERT_EQ(imported.status, 201) << imported.body;
  const std::string reference = imported.json()["id"];
  const json scene = SceneOf(reference);
  EXPECT_EQ(scene["planning"]["skin_threshold_hu"], -350);
  EXPECT_THAT(scene["warnings"].dump(),
              AllOf(HasSubstr("CT images at -350 HU"), HasSubstr("the couch, whose top"),
                    HasSubstr("compare both ends")));
  Approve(reference, /*skin_of_images=*/true);
  EXPECT_THAT(engineer_->Get("/api/v1/audit").body, HasSubstr("CT images at -350 HU confirmed"));

  CalibrateRoom();
  const json result = ScanFraction("skin of the CT images at -350 HU");
  EXPECT_EQ(result["compared_with"]["skin_threshold_hu"], -350);
  EXPECT_DOUBLE_EQ(result["compared_with"]["skin_u95_mm"].get<double>(),
                   1e3 * scene["planning"]["skin_u95_m"].get<double>());
  ASSERT_TRUE(result["correction"].is_object()) << result["reasons"].dump();
  ExpectShifts(result["correction"], TrueCouch());
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "state"))
    EXPECT_NE(entry.path().extension(), ".dcm") << "the files name the patient";
}

TEST_F(DaemonPlanningTest, FilesOfAnotherPatientAreRefusedUntilAPersonHasLooked) {
  const std::string id = "KH-4711-SECRET";
  ASSERT_EQ(Upload({}, id).status, 201) << "the first ones are nobody else's";
  EXPECT_EQ(Upload({}, id + " ").status, 201) << "the same, padded";
  const auto other = Upload({}, "KH-4712");
  EXPECT_EQ(other.status, 409) << other.body;
  EXPECT_EQ(other.json()["error_message"]["id"], "store.planning_patient_differs");
  EXPECT_EQ(Upload({}, "KH-4712", "&same_patient=yes").json()["error_message"]["id"],
            "store.planning_needs_reason");
  const auto confirmed = Upload({}, "KH-4712", "&same_patient=yes&reason=renumbered");
  EXPECT_EQ(confirmed.status, 201) << confirmed.body;
  const json log = engineer_->Get("/api/v1/audit").json()["entries"];
  const auto row = std::find_if(
      log.begin(), log.end(), [](const json& entry) { return entry["action"] == "reference.add"; });
  ASSERT_NE(row, log.end());
  EXPECT_THAT((*row)["detail"].get<std::string>(),
              AllOf(HasSubstr("another Patient ID"), HasSubstr("renumbered")));
  EXPECT_EQ(Upload({}, "KH-4712").status, 201) << "what was confirmed counts from now on";

  // The same files for another patient here.
  const std::string first = patient_;
  patient_ = planner_->Post("/api/v1/patients", {{"code", "CT-2"}, {"site", "thorax"}})
                 .json()
                 .value("id", "");
  const auto mixed = Upload({}, id);
  EXPECT_EQ(mixed.json()["error_message"]["id"], "store.planning_patient_of") << mixed.body;
  EXPECT_THAT(mixed.body, HasSubstr("CT-1"));
  EXPECT_EQ(Upload({}, "KH-9").status, 201);

  // Nothing that is stored names the patient. While plumbd runs, files come and go.
  EXPECT_EQ(plumbd_->Stop(), 0);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.path())) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), {});
    EXPECT_EQ(bytes.find(id), std::string::npos) << entry.path();
  }
}

}  // namespace
}  // namespace plumb
