// SPDX-License-Identifier: Apache-2.0
// One patient out of a store, and into another one.
#include "daemon/archive/patient_transfer.hpp"

#include <fstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/archive/backup.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/imports/imported_room.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/board_checks.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using testing::FilesBelow;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kAnna;
using testing::kBert;
using testing::MessageOf;
using ::testing::Not;
using testing::PlanAndApprove;
using testing::StoreScan;

class PatientTransferTest : public ::testing::Test {
 protected:
  /// Somebody else before and after, so that numbers differ between the stores.
  PatientTransferTest() {
    Store store(here());
    const std::string other = store.patients.Add(kAnna, "OTHER", "");
    (void)StoreScan(store, other);
    patient_ = store.patients.Add(kAnna, "P-7", "thorax");
    const std::string session = store.treatments.Open(kAnna, patient_, ScanPurpose::kFraction);
    reference_ = StoreScan(store, patient_);
    const std::string draft = store.references.Add(kAnna, reference_, "first", plan_);
    (void)PlanAndApprove(store, draft);
    NewScan begun = testing::Begun(patient_);
    begun.reference_id = draft;
    begun.session_id = session;
    begun.purpose = ScanPurpose::kFraction;
    scan_ = store.scans.Begin(begun);
    testing::FillScan(store.folders.Staging(scan_));
    store.scans.Finish(scan_, {.outcome = ScanOutcome::kDone,
                               .result_json = testing::ResultWith(R"({"verdict":"in_tolerance"})"),
                               .swept_area_m2 = 0.5});
    store.audit.Log(kAnna, "scan.start", session, "fraction");
    store.audit.Log(kAnna, "scan.start", "", "unassigned");
    store.scans.Accept(kAnna, scan_);
    const std::string failed = store.scans.Begin(testing::Begun(patient_));
    store.scans.Finish(
        failed, {.outcome = ScanOutcome::kFailed, .failure = Message::Verbatim("no marker")});
    store.treatments.CloseAll(kAnna);
    Store there(this->there());
    for (const char* code : {"A", "B", "C"}) (void)there.patients.Add(kAnna, code, "");
    for (int i = 0; i < 5; ++i) (void)StoreScan(there, "1");
  }
  [[nodiscard]] fs::path here() const { return folder_ / "here"; }
  [[nodiscard]] fs::path there() const { return folder_ / "there"; }
  [[nodiscard]] fs::path out() const { return folder_ / "out"; }

  /// Plans the newest reference of that unit anew: an approved one gets a next version.
  static void ChangePlan(const fs::path& state, double tolerance_mm) {
    Store store(state);
    const Reference newest = store.references.List(store.patients.FindByCode("P-7")->id).front();
    ReferencePlan plan = newest.plan;
    plan.tolerance.shift_mm = tolerance_mm;
    (void)store.references.Plan(kAnna, newest.id, newest.revision, plan);
  }
  /// All that the unit says of the patient's references, the newest first.
  static std::vector<std::string> ReferencesIn(const fs::path& state) {
    Store store(state);
    std::vector<std::string> all;
    for (const Reference& one : store.references.List(store.patients.FindByCode("P-7")->id))
      all.push_back(fmt::format("{} v{} r{} {} {}", one.id, one.version, one.revision,
                                one.approved_by, PlanJson(one.plan)));
    return all;
  }
  /// Imports one unit's present data into the other: it must be refused and change nothing.
  void ExpectConflict(const fs::path& from, const fs::path& to, const char* name) {
    const auto before = ReferencesIn(to);
    (void)ExportPatient(from, "P-7", folder_ / name);
    EXPECT_THROW((void)ImportPatient(folder_ / name, to), std::invalid_argument);
    EXPECT_EQ(ReferencesIn(to), before);
  }

  [[nodiscard]] std::string WhyNot() const {
    return MessageOf<DataError>([&] { (void)ImportPatient(out(), there()); });
  }
  /// Changes the record and makes the sums fit, as somebody who means ill would.
  void Forge(const std::function<void(Json& record)>& change) const {
    Json record = Json::parse(FilesBelow(out()).at("record.json"));
    change(record);
    WriteWholeFile(out() / "record.json", std::string_view(record.dump()));
    Resum([](std::string&) {});
  }
  void Resum(const std::function<void(std::string& sums)>& change) const {
    const auto files = FilesBelow(out());
    std::string sums;
    sums += DigestOfFile(out(), "record.json").sha256 + "  record.json\n";
    for (const auto& [name, content] : files) {
      if (name.starts_with("scans/")) sums += DigestOfFile(out(), name).sha256 + "  " + name + "\n";
    }
    change(sums);
    WriteWholeFile(out() / "SHA256SUMS", std::string_view(sums));
    Json about = Json::parse(files.at("patient.json"));
    about["sha256sums"] = DigestOfFile(out(), "SHA256SUMS").sha256;
    WriteWholeFile(out() / "patient.json", std::string_view(about.dump()));
  }
  /// What must hold after a refusal.
  void ExpectNothingCame() const {
    EXPECT_FALSE(fs::exists(there() / ".import"));
    Store store(there());
    EXPECT_EQ(store.patients.FindByCode("P-7"), std::nullopt);
    EXPECT_EQ(store.scans.List("", 100).size(), 5U);
    EXPECT_EQ(store.recovery().foreign_folders, 0);
    EXPECT_EQ(store.audit.Find({0, 1})[0].action, "patient.add");
  }

  testing::TempFolder folder_;
  const ReferencePlan plan_ = [] {
    ReferencePlan plan;
    plan.region_m = {{0.1, 0.2}, {0.3, 0.2}, {0.3, 0.5}};
    return plan;
  }();
  std::string patient_, reference_, scan_;
};

TEST_F(PatientTransferTest, ComesWithEverythingAndByteIdenticalFiles) {
  const PatientReport exported = ExportPatient(here(), "p-7", out());
  EXPECT_EQ(exported.code, "P-7");
  EXPECT_EQ(exported.scans, 3U);
  EXPECT_EQ(exported.references, 1U);
  EXPECT_EQ(exported.files, 1U + 2 * 7);
  EXPECT_THAT(exported.problems, IsEmpty());
  const PatientReport imported = ImportPatient(out(), there());
  EXPECT_FALSE(imported.was_there);
  {
    Store store(here());
    const AuditEntry entry = store.audit.Find({0, 1}).at(0);
    EXPECT_EQ(entry.user + " " + entry.action + " " + entry.subject,
              "command line patient.export " + patient_);
    EXPECT_EQ(entry.detail.English(),
              "P-7 to " + out().string() + ": 3 scans, 1 reference, 0 problems");
    EXPECT_EQ(store.audit.FirstBroken(), std::nullopt);
  }
  EXPECT_EQ(imported.files, exported.files);
  Store from(here()), to(there());
  const auto patient = to.patients.FindByCode("P-7");
  ASSERT_TRUE(patient);
  EXPECT_EQ(patient->site, "thorax");
  const auto before = from.scans.List(patient_, 10), now = to.scans.List(patient->id, 10);
  ASSERT_EQ(now.size(), 3U);
  for (std::size_t i = 0; i < now.size(); ++i) {
    EXPECT_NE(now[i].id, before[i].id);
    EXPECT_EQ(now[i].outcome, before[i].outcome);
    EXPECT_EQ(now[i].failure, before[i].failure);
    EXPECT_EQ(now[i].started_at, before[i].started_at);
    EXPECT_EQ(now[i].accepted_by, before[i].accepted_by);
    EXPECT_EQ(now[i].accepted_at, before[i].accepted_at);
    EXPECT_EQ(now[i].fraction, before[i].fraction);
    EXPECT_EQ(now[i].result.has_value(), before[i].result.has_value());
    EXPECT_EQ(FilesBelow(now[i].folder), FilesBelow(before[i].folder));
    EXPECT_EQ(now[i].folder.empty() ? "" : to.integrity.Check(now[i].id, false).English(), "");
  }
  const auto references = to.references.List(patient->id);
  ASSERT_EQ(references.size(), 1U);
  EXPECT_EQ(PlanJson(references[0].plan), PlanJson(plan_));
  EXPECT_EQ(references[0].created_by, "anna");
  EXPECT_EQ(references[0].approved_by, "") << "approved in another room";
  EXPECT_EQ(references[0].scan_id, now[2].id);
  EXPECT_EQ(now[1].reference_id, references[0].id);
  to.references.Approve(kBert, references[0].id, references[0].revision);
  EXPECT_EQ(to.recovery().foreign_folders + to.recovery().lost_scans, 0);
  EXPECT_EQ(to.treatments.Opened(), std::nullopt);
  EXPECT_EQ(to.audit.FirstBroken(), std::nullopt);
  EXPECT_THAT(to.audit.Find({0, 2})[1].action, "patient.import");
  EXPECT_THAT(to.audit.Find({0, 2})[1].detail.English(),
              AllOf(HasSubstr("P-7"), HasSubstr("3 scans")));
  const Json kept = Json::parse(FilesBelow(there()).at("imports/" + patient->id + ".json"));
  EXPECT_THAT(
      kept["evidence"]["audit"].dump(),
      AllOf(HasSubstr("reference.approve"), HasSubstr("scan.accept"), HasSubstr("session.open"),
            HasSubstr("scan.start"), HasSubstr("patient.add"), Not(HasSubstr("unassigned"))));
  to.removal.WipePatient(kAnna, patient->id);
  EXPECT_THAT(FilesBelow(there() / "imports"), IsEmpty()) << "wiped with the patient";
}

TEST_F(PatientTransferTest, PhotoAndDrawingOfTheSetUpSheetComeAlong) {
  const std::string jpeg = "\xFF\xD8" + std::string(kMaxPhoto - 2, '\0');
  const std::vector<DrawnPoint> drawn(kMaxDrawnPoints, {1.0, 0.999, false});
  {
    Store store(here());
    store.patients.SetPhoto(kAnna, patient_, jpeg);
    store.patients.SetDrawing(kAnna, patient_, drawn, 1);
  }
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  Store to(there());
  const auto patient = to.patients.FindByCode("P-7");
  ASSERT_TRUE(patient);
  EXPECT_TRUE(patient->has_photo);
  EXPECT_EQ(to.patients.Photo(patient->id), jpeg) << "the largest there is";
  EXPECT_EQ(to.patients.Drawing(patient->id), drawn);
}

TEST_F(PatientTransferTest, GoesRoundAndIsTheSame) {
  (void)ExportPatient(here(), "P-7", out());
  EXPECT_TRUE(ImportPatient(out(), here()).was_there) << "where it came from";
  EXPECT_FALSE(ImportPatient(out(), there()).was_there);
  const auto files = FilesBelow(there() / "scans");
  EXPECT_TRUE(ImportPatient(out(), there()).was_there) << "a second time";
  EXPECT_EQ(FilesBelow(there() / "scans"), files);
  // And back, from a backup, into an empty store: what the first log said is still there.
  (void)BackUpStopped(there(), folder_ / "backup");
  (void)ExportPatient(folder_ / "backup", "P-7", folder_ / "out2");
  const fs::path third = folder_ / "third";
  { Store store(third); }
  (void)ImportPatient(folder_ / "out2", third);
  Store store(third);
  const auto patient = store.patients.FindByCode("P-7");
  ASSERT_TRUE(patient);
  EXPECT_THAT(FilesBelow(third).at("imports/" + patient->id + ".json"),
              HasSubstr("reference.approve"));
  Store first(here());
  const auto before = first.scans.List(patient_, 10), now = store.scans.List(patient->id, 10);
  for (std::size_t i = 0; i < now.size(); ++i)
    EXPECT_EQ(FilesBelow(now[i].folder), FilesBelow(before[i].folder));
}

TEST_F(PatientTransferTest, TheRoomOfAReferenceComesAlongAndGoesOn) {
  {
    Store store(here());
    for (int i = 0; i < 3; ++i) store.checks.Add(kAnna, "S1", testing::CheckOver(0.0));
    const auto since = WallClock::now() - std::chrono::hours(1);
    (void)store.room.Sign(kAnna, "S1", since, store.room.Candidate("S1", since).digest);
  }
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  std::string patient, scan;
  {
    Store store(there());
    patient = store.patients.FindByCode("P-7")->id;
    scan = store.references.List(patient).at(0).scan_id;
  }
  const auto room = RoomOfImport(there(), patient, scan);
  ASSERT_TRUE(room && room->room) << (room ? room->why_not.English() : "none");
  EXPECT_EQ(room->version, 1);
  EXPECT_GT(room->room->signed_at, WallClock::now() - std::chrono::hours(1));
  EXPECT_EQ(room->room->fit.markers_iec.size(), testing::MarkersOfRoom().size());
  EXPECT_FALSE(RoomOfImport(there(), patient, "999")) << "a scan that was made here";
  EXPECT_FALSE(RoomOfImport(here(), patient_, reference_)) << "where it came from";

  // A third unit learns the room of the first from the second.
  (void)ExportPatient(there(), "P-7", folder_ / "out2");
  const fs::path third = folder_ / "third";
  { Store store(third); }
  (void)ImportPatient(folder_ / "out2", third);
  {
    Store store(third);
    patient = store.patients.FindByCode("P-7")->id;
    scan = store.references.List(patient).at(0).scan_id;
  }
  EXPECT_TRUE(RoomOfImport(third, patient, scan)->room);

  // What is not as it was signed is no room.
  std::string text = ReadTextFile(ImportedFile(third, std::stoll(patient)), 1 << 24);
  constexpr std::string_view kSpread = R"(shift_m\":)";  // in a text within the text
  text.at(text.find(kSpread, text.rfind("rooms_here")) + kSpread.size()) = '9';
  std::ofstream(ImportedFile(third, std::stoll(patient))) << text;
  const auto changed = RoomOfImport(third, patient, scan);
  ASSERT_TRUE(changed);
  EXPECT_FALSE(changed->room);
  EXPECT_THAT(changed->why_not.English(), HasSubstr("not as it was signed"));
}

TEST_F(PatientTransferTest, AReferenceOfARoomThatIsNotCalibratedSaysSo) {
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  Store store(there());
  const std::string patient = store.patients.FindByCode("P-7")->id;
  const auto room = RoomOfImport(there(), patient, store.references.List(patient).at(0).scan_id);
  ASSERT_TRUE(room);
  EXPECT_FALSE(room->room);
  EXPECT_THAT(room->why_not.English(), HasSubstr("not calibrated"));
}

/// The rule where both units went on with a patient: nothing is merged, and none of them wins.
TEST_F(PatientTransferTest, WhatWasChangedInBothUnitsStaysAsItIsInBoth) {
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  {
    Store first(here()), second(there());
    (void)StoreScan(first, patient_);
    (void)StoreScan(second, second.patients.FindByCode("P-7")->id);
  }
  const auto files_here = FilesBelow(here() / "scans"), files_there = FilesBelow(there() / "scans");
  (void)ExportPatient(here(), "P-7", folder_ / "out2");
  (void)ExportPatient(there(), "P-7", folder_ / "out3");
  EXPECT_THROW((void)ImportPatient(folder_ / "out2", there()), std::invalid_argument);
  EXPECT_THROW((void)ImportPatient(folder_ / "out3", here()), std::invalid_argument);
  EXPECT_EQ(FilesBelow(here() / "scans"), files_here);
  EXPECT_EQ(FilesBelow(there() / "scans"), files_there);
}

TEST_F(PatientTransferTest, ANewerPlanDoesNotReplaceTheOneInUse) {
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  {
    Store store(there());
    const Reference draft = store.references.List(store.patients.FindByCode("P-7")->id).front();
    store.references.Approve(kBert, draft.id, draft.revision);
  }
  ChangePlan(here(), 2.0);
  ExpectConflict(here(), there(), "newer");
  EXPECT_THAT(ReferencesIn(there()), ElementsAre(HasSubstr("bert")));
}

TEST_F(PatientTransferTest, AnOlderPlanDoesNotComeBack) {
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  ChangePlan(here(), 2.0);
  ChangePlan(there(), 4.0);
  const auto first = ReferencesIn(here()), second = ReferencesIn(there());
  EXPECT_THROW((void)ImportPatient(out(), here()), std::invalid_argument);
  EXPECT_TRUE(ImportPatient(out(), there()).was_there) << "the very export that was imported";
  EXPECT_EQ(ReferencesIn(here()), first);
  EXPECT_EQ(ReferencesIn(there()), second);
}

TEST_F(PatientTransferTest, PlansThatWereChangedInBothUnitsStayInBoth) {
  (void)ExportPatient(here(), "P-7", out());
  (void)ImportPatient(out(), there());
  ChangePlan(here(), 2.0);
  ChangePlan(there(), 4.0);
  ExpectConflict(here(), there(), "first");
  ExpectConflict(there(), here(), "second");
  // A person decides: what is wiped in one unit comes from the other, and nothing of it is
  // approved.
  {
    Store store(there());
    store.removal.WipePatient(kAnna, store.patients.FindByCode("P-7")->id);
  }
  (void)ImportPatient(folder_ / "first", there());
  const auto came = ReferencesIn(there()), there_were = ReferencesIn(here());
  ASSERT_EQ(came.size(), there_were.size());
  for (const std::string& one : came) EXPECT_THAT(one, Not(HasSubstr("bert")));
  EXPECT_THAT(came.front(), HasSubstr("2.0"));
}

TEST_F(PatientTransferTest, OfTwoCodesThatDifferInHyphensTheExactOneIsTaken) {
  {
    // Units before 0.3.0 took both.
    Database database(here() / "plumb.db", Database::Access::kReadWrite);
    database.Run("INSERT INTO patients (code, site, created_at) VALUES ('P7', '', 1)");
  }
  const auto scans_of = [&](const char* code, const char* name) {
    return ExportPatient(here(), code, folder_ / name).scans;
  };
  EXPECT_EQ(scans_of("p-7", "hyphen"), 3U);
  EXPECT_EQ(scans_of("P7", "plain"), 0U);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ExportPatient(here(), "P--7", folder_ / "x"); }),
              AllOf(HasSubstr("P-7"), HasSubstr("P7"), HasSubstr("exactly")));
}

TEST_F(PatientTransferTest, ACodeWithOtherDataIsRefused) {
  (void)ExportPatient(here(), "P-7", out());
  {
    Store store(there());
    (void)store.patients.Add(kAnna, "p-7", "");
  }
  EXPECT_THAT(
      MessageOf<std::invalid_argument>([&] { (void)ImportPatient(out(), there()); }),
      AllOf(HasSubstr("P-7"), HasSubstr("not with the same data"), HasSubstr("nothing was")));
  {
    Database database(there() / "plumb.db", Database::Access::kReadWrite);
    database.Run("UPDATE patients SET code = 'P7' WHERE code = 'p-7'");
    database.Run("INSERT INTO patients (code, site, created_at) VALUES ('P--7', '', 1)");
  }
  EXPECT_THAT(MessageOf<std::invalid_argument>([&] { (void)ImportPatient(out(), there()); }),
              HasSubstr("not with the same data"))
      << "two have the code but for hyphens, neither exactly";
  {
    Store store(here());
    (void)StoreScan(store, patient_);
  }
  EXPECT_THROW((void)ImportPatient(out(), here()), std::invalid_argument)
      << "a scan has been made since";
  EXPECT_THROW((void)ExportPatient(here(), "NOBODY", folder_ / "x"), DataError);
  EXPECT_FALSE(fs::exists(folder_ / "x"));
}

TEST_F(PatientTransferTest, WhatIsNotWholeIsRefused) {
  (void)ExportPatient(here(), "P-7", out());
  for (const auto& [name, content] : FilesBelow(out())) {
    SCOPED_TRACE(name);
    WriteWholeFile(out() / name, std::string_view(content).substr(0, content.size() / 2));
    EXPECT_THAT(WhyNot(), HasSubstr("nothing was"));
    fs::remove(out() / name);
    EXPECT_THAT(WhyNot(), HasSubstr(name));
    WriteWholeFile(out() / name, std::string_view(content));
  }
  ExpectNothingCame();
}

TEST_F(PatientTransferTest, APathThatIsNoneOfAnExportIsRefused) {
  (void)ExportPatient(here(), "P-7", out());
  for (const char* path :
       {"../evil", "/etc/evil", "scans/../../evil", "scans/000001", "scans/1/x", "plumb.db",
        "scans/000001/../../../evil", "scans/000001/a\tb", "imports/1.json", ""}) {
    Resum([&](std::string& sums) { sums += std::string(64, '0') + "  " + path + "\n"; });
    EXPECT_THAT(WhyNot(), HasSubstr("SHA256SUMS")) << path;
  }
  fs::create_directories(out() / "scans" / "000999" / "scene");
  WriteWholeFile(out() / "scans/000999/scene/x", std::string_view("x"));
  Resum([](std::string&) {});
  EXPECT_THAT(WhyNot(), HasSubstr("belongs to no scan"));
  EXPECT_FALSE(fs::exists(folder_ / "evil"));
  ExpectNothingCame();
}

TEST_F(PatientTransferTest, ARecordThatSaysWhatNoneCanIsRefused) {
  (void)ExportPatient(here(), "P-7", out());
  const std::string whole = FilesBelow(out()).at("record.json");
  const auto refused = [&](const std::string& what,
                           const std::function<void(Json & rows)>& change) {
    WriteWholeFile(out() / "record.json", std::string_view(whole));
    Forge([&](Json& record) { change(record["rows"]); });
    EXPECT_THAT(WhyNot(), HasSubstr(what));
  };
  refused("patients.code", [](Json& rows) { rows["patients"][0].erase("code"); });
  refused("a code", [](Json& rows) { rows["patients"][0]["code"] = "a'; DROP TABLE refs; --"; });
  refused("a code", [](Json& rows) { rows["patients"][0]["code"] = std::string(33, 'x'); });
  refused("patients.site", [](Json& rows) { rows["patients"][0]["site"] = 7; });
  refused("patients.site",
          [](Json& rows) { rows["patients"][0]["site"] = std::string(65537, 'x'); });
  refused("patients.site no plain text",
          [](Json& rows) { rows["patients"][0]["site"] = "thorax\u202E"; });
  refused("does not know", [](Json& rows) { rows["patients"][0]["code) VALUES (1); --"] = 1; });
  refused("one patient", [](Json& rows) {
    rows["patients"].push_back(rows["patients"][0]);
    rows["patients"][1]["id"] = 99;
  });
  refused("scans.started_at",
          [](Json& rows) { rows["scans"][0]["started_at"] = std::int64_t{1} << 60; });
  refused("a scan that runs", [](Json& rows) { rows["scans"][0]["outcome"] = "running"; });
  refused("breaks a rule", [](Json& rows) { rows["scans"][0]["outcome"] = "splendid"; });
  refused("refs.source", [](Json& rows) { rows["refs"][0]["source"] = "hearsay"; });
  refused("scans.reference_id", [](Json& rows) { rows["scans"][0]["reference_id"] = 4711; });
  refused("refs.scan_id", [](Json& rows) { rows["refs"][0]["scan_id"] = 1; });
  refused("results.scan_id", [](Json& rows) { rows["results"][0]["scan_id"] = 1; });
  refused("a number twice", [](Json& rows) { rows["scans"][1]["id"] = rows["scans"][0]["id"]; });
  refused("plan", [](Json& rows) { rows["refs"][0]["plan"] = "{}"; });
  refused("", [](Json& rows) { rows["results"][0]["json"] = "no json"; });
  refused("scan_files", [](Json& rows) { rows["scan_files"][0]["path"] = "../../plumb.db"; });
  refused("scan_files", [](Json& rows) { rows["scan_files"][0]["sha256"] = "x"; });
  refused("no refs", [](Json& rows) { rows.erase("refs"); });
  refused("scans.has_folder", [](Json& rows) { rows["scans"][0]["has_folder"] = nullptr; });
  refused("scans.id", [](Json& rows) { rows["scans"][0]["id"] = nullptr; });
  refused("no row", [](Json& rows) { rows["scans"][0] = 7; });
  refused("no rows", [](Json& rows) { rows = 7; });
  ExpectNothingCame();
}

TEST_F(PatientTransferTest, WhatWasDamagedIsTold) {
  WriteWholeFile(here() / "scans" / scan_ / "scene" / "cloud.ply", std::string_view("changed"));
  fs::remove(here() / "scans" / reference_ / "scene" / "mesh.ply");
  EXPECT_THAT(EnglishTexts(ExportPatient(here(), "P-7", out()).problems),
              ::testing::UnorderedElementsAre(
                  AllOf(HasSubstr(scan_), HasSubstr("cloud.ply"), HasSubstr("not what")),
                  AllOf(HasSubstr(reference_), HasSubstr("mesh.ply"), HasSubstr("missing"))));
}

}  // namespace
}  // namespace plumb
