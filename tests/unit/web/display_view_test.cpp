// SPDX-License-Identifier: Apache-2.0
// What a paired display in the room may read: what the status names.
#include "web/api/display_view.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Two patients, each with a reference and two scans, the first of which is the reference's. The
/// session of the first patient is open and s2 is its last result.
class DisplayViewTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
    loop_->Do([&] {
      for (const std::string number : {"2", "1"}) {
        Patient& patient = service_.patients.emplace_back();
        patient.id = "p" + number;
        patient.code = "PX-" + number;
        patient.approved_reference_id = "r" + number;
        Reference& reference = service_.references.emplace_back();
        reference.id = "r" + number;
        reference.patient_id = patient.id;
        reference.scan_id = AddScan(number + "0", patient.id, "").id;
        AddScan(number, patient.id, reference.id);
      }
      service_.make_map = [](const auto&, const auto&) { return std::string("a map"); };
      Open("p1", "t1");
      service_.status.last_result = service_.FindScan("s1");
    });
    display_ = std::make_unique<HttpClient>(port_);
    HttpClient engineer = LoggedIn("engineer");
    const nlohmann::json pairing = display_->Post("/api/v1/displays/pair").json();
    ASSERT_EQ(engineer
                  .Post("/api/v1/displays",
                        {{"code", pairing["code"]}, {"name", "room"}, {"password", kPassword}})
                  .status,
              201);
    ASSERT_EQ(display_->Post("/api/v1/displays/claim", {{"secret", pairing["secret"]}}).status,
              200);
    technician_ = std::make_unique<HttpClient>(LoggedIn("technician"));
  }

  Scan& AddScan(const std::string& number, const std::string& patient,
                const std::string& reference) {
    Scan& scan = service_.scans.emplace_back();
    scan.id = "s" + number;
    scan.patient_id = patient;
    scan.reference_id = reference;
    scan.session_id = "t" + patient.substr(1);
    scan.outcome = ScanOutcome::kDone;
    scan.started_at = scan.finished_at.emplace(WallClock::now());
    scan.folder = folder_.path() / scan.id;
    for (const char* file : {"scene/scene.json", "scene/mesh.ply", "result/result.json"}) {
      std::filesystem::create_directories((scan.folder / file).parent_path());
      std::ofstream(scan.folder / file) << "{}";
    }
    if (!reference.empty()) scan.result.emplace().verdict = Verdict::kInTolerance;
    return scan;
  }

  void Open(const std::string& patient, const std::string& session) {
    TreatmentSession& open = service_.status.session.emplace();
    open.id = session;
    open.patient_id = patient;
    open.reference = {.id = "r" + patient.substr(1), .version = 1};
  }

  /// The answers to a display and to a person.
  void ExpectHidden(const std::string& path) {
    const HttpAnswer answer = display_->Get("/api/v1/" + path);
    EXPECT_EQ(answer.status, 404) << path;
    EXPECT_EQ(technician_->Get("/api/v1/" + path).status, 200) << path;
    // As if it did not exist.
    std::string absent = path;
    absent.replace(absent.find('/') + 1, 2, "x9");
    EXPECT_EQ(answer.body, display_->Get("/api/v1/" + absent).body) << path;
  }
  void ExpectShown(const std::string& path) {
    EXPECT_EQ(display_->Get("/api/v1/" + path).status, 200) << path;
  }

  plumb::testing::TempFolder folder_;
  std::unique_ptr<HttpClient> display_, technician_;
};

TEST_F(DisplayViewTest, ItReadsWhatTheStatusNames) {
  for (const char* path :
       {"status", "patients/p1", "references/r1", "scans/s1", "results/s1",
        "scans/s1/files/scene.json", "scans/s1/files/result.json", "scans/s1/maps/deviation",
        "scans/s1/quality", "scans/s10/files/scene.json"})
    ExpectShown(path);
}

TEST_F(DisplayViewTest, AnythingElseIsAsIfItDidNotExist) {
  for (const char* path :
       {"patients/p2", "references/r2", "scans/s2", "results/s2", "scans/s2/files/scene.json",
        "scans/s2/files/result.json", "scans/s2/maps/deviation", "scans/s2/quality",
        "scans/s20/files/scene.json"})
    ExpectHidden(path);
  // Of the reference's scan it needs the grid of the map alone.
  for (const char* path :
       {"scans/s10", "scans/s10/quality", "scans/s10/files/mesh.ply", "scans/s10/maps/heightmap"})
    ExpectHidden(path);
}

TEST_F(DisplayViewTest, ItFollowsTheStatus) {
  loop_->Do([&] { Open("p2", "t2"); });
  ExpectShown("patients/p2");
  ExpectShown("patients/p1");    // of the last result, which the status still names
  ExpectShown("references/r2");  // the posture that is planned, during the sweep
  for (const char* path : {"scans/s2", "results/s2", "scans/s20/files/scene.json"})
    ExpectHidden(path);
  loop_->Do([&] {
    service_.status.session.reset();
    service_.status.last_result = service_.FindScan("s2");
  });
  ExpectShown("scans/s2");
  for (const char* path :
       {"patients/p1", "scans/s1", "references/r1", "scans/s10/files/scene.json"})
    ExpectHidden(path);
  loop_->Do([&] { service_.status.last_result.reset(); });  // a restart of the appliance
  for (const char* path : {"patients/p2", "scans/s2", "references/r2", "results/s2"})
    ExpectHidden(path);
}

TEST_F(DisplayViewTest, ThePageWithoutScriptShowsTheLastResultInItsOwnSessionOnly) {
  const auto page = [&](const std::string& query = "") {
    return display_->Get("/result" + query).body;
  };
  for (const char* query : {"", "?scan=s1"}) EXPECT_THAT(page(query), HasSubstr("PX-1")) << query;
  const std::string absent = page("?scan=x9");
  for (const char* query : {"?scan=s2", "?scan=s10"}) EXPECT_EQ(page(query), absent) << query;
  EXPECT_THAT(technician_->Get("/result?scan=s2").body, HasSubstr("PX-2"));

  loop_->Do([&] {
    service_.scans.push_back(*service_.FindScan("s1"));
    service_.scans.back().id = "s3";
    service_.scans.back().outcome = ScanOutcome::kFailed;
    service_.scans.back().failure = Message::Verbatim("tracking was lost");
  });
  EXPECT_THAT(page(), HasSubstr("racking was lost"));
  loop_->Do([&] { Open("p2", "t2"); });
  for (const char* query : {"", "?scan=s1", "?scan=s3"})
    EXPECT_THAT(page(query), Not(HasSubstr("PX-1"))) << query;
  loop_->Do([&] { service_.status.session.reset(); });
  EXPECT_THAT(page(), Not(HasSubstr("PX-")));
}

}  // namespace
}  // namespace plumb::test
