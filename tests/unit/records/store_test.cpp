// The store: its rules, and what it makes of a crash at each point.
#include "daemon/records/store.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/records/check_json.hpp"
#include "daemon/records/schema.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::MessageOf;
using ::testing::SizeIs;
using web::ChangeResult;

const web::Actor kAnna{.user = "anna", .address = "::1"};
const web::Actor kBert{.user = "bert", .address = "::1"};
const char* const kResult =
    R"({"verdict":"move","reasons":["vertical is off"],"correction":{"vertical_mm":6.5,"longitudinal_mm":null,)"
    R"("lateral_mm":-1,"pitch_deg":0.5,"roll_deg":0,"yaw_deg":2,)"
    R"("uncertainty":{"vertical_mm":1.2,"pitch_deg":0.2,"roll_deg":0.3,"yaw_deg":0.1}}})";

class StoreTest : public ::testing::Test {
 protected:
  std::unique_ptr<Store> Open() const { return std::make_unique<Store>(folder_ / "state"); }

  static void FillStaging(const Store& store, const std::string& id) {
    fs::create_directories(store.StagingFolder(id) / "scene");
    WriteWholeFile(store.StagingFolder(id) / "scene" / "scene.json", std::string_view("{}"));
  }
  static std::string Scan(Store& store, const std::string& patient,
                          const std::string& reference = "", const std::string& result = "") {
    const std::string id = store.BeginScan({.patient_id = patient,
                                            .reference_id = reference,
                                            .purpose = {},
                                            .sensor_serial = "S1",
                                            .reason = {}});
    FillStaging(store, id);
    store.FinishScan(id, {.outcome = web::ScanOutcome::kDone,
                          .failure = {},
                          .result_json = result,
                          .swept_area_m2 = 2.5});
    return id;
  }
  static std::string ApprovedReference(Store& store, const std::string& patient) {
    const std::string id = store.AddReference(kAnna, Scan(store, patient), "first", {});
    store.ApproveReference(kBert, id, 1);
    return id;
  }
  template <typename Call>
  static ChangeResult RefusalOf(const Call& call) {
    try {
      call();
    } catch (const StoreRefusal& refusal) {
      EXPECT_STRNE(refusal.what(), "");
      return refusal.result();
    }
    return ChangeResult::kDone;
  }
  [[nodiscard]] fs::path database() const { return folder_ / "state" / "plumb.db"; }

  testing::TempFolder folder_;
};

TEST_F(StoreTest, KeepsEverythingOverARestart) {
  std::string patient, scan;
  {
    const auto store = Open();
    patient = store->AddPatient(kAnna, "P-17", "thorax");
    const std::string reference = ApprovedReference(*store, patient);
    scan = Scan(*store, patient, reference, kResult);
    store->AcceptScan(kAnna, scan, "the swelling is known");
    store->ChangeSettings(kAnna, {.tolerance = {}, .posture = "FFS", .retention_days = 30});
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().interrupted_scans + store->recovery().orphaned_folders +
                store->recovery().lost_scans,
            0);
  const auto found = store->FindScan(scan);
  ASSERT_TRUE(found && found->result && found->result->correction);
  EXPECT_EQ(found->patient_id, patient);
  EXPECT_EQ(found->accepted_by, "anna");
  EXPECT_EQ(found->accepted_reason, "the swelling is known");
  ASSERT_TRUE(found->accepted_at);
  EXPECT_LT(web::WallClock::now() - *found->accepted_at, std::chrono::minutes(1));
  EXPECT_EQ(found->result->verdict, "move");
  EXPECT_EQ(found->result->correction->vertical_mm, 6.5);
  EXPECT_EQ(found->result->correction->longitudinal_mm, std::nullopt);
  EXPECT_EQ(found->result->u95->vertical_mm, 1.2);
  EXPECT_EQ(found->folder, store->ScanFolder(scan));
  EXPECT_EQ(store->FindPatientByCode("P-17")->approved_reference_id, found->reference_id);
  EXPECT_EQ(store->GetSettings().posture, "FFS");
  EXPECT_EQ(store->GetSettings().retention_days, 30);
  EXPECT_EQ(store->SweptArea(scan), 2.5);
}

TEST_F(StoreTest, AScanThatWasRunningAtACrashHasFailedAndLeavesNothing) {
  std::string patient, id;
  {
    const auto store = Open();
    patient = store->AddPatient(kAnna, "A", "");
    id = store->BeginScan({.patient_id = patient,
                           .reference_id = {},
                           .purpose = {},
                           .sensor_serial = {},
                           .reason = {}});
    FillStaging(*store, id);
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().interrupted_scans, 1);
  EXPECT_EQ(store->FindScan(id)->outcome, web::ScanOutcome::kFailed);
  EXPECT_THAT(store->FindScan(id)->failure, HasSubstr("interrupted"));
  EXPECT_TRUE(fs::is_empty(folder_ / "state" / "scans"));
}

TEST_F(StoreTest, ScansOfALostDatabaseAreNeverTakenForOrphans) {
  std::string scan;
  {
    const auto store = Open();
    scan = Scan(*store, store->AddPatient(kAnna, "A", ""));
  }
  const fs::path folder = folder_ / "state" / "scans" / scan;
  const std::vector<std::uint8_t> kept = ReadWholeFile(database(), 1 << 26);
  for (const bool is_empty : {false, true}) {
    fs::remove(database());
    if (is_empty) WriteWholeFile(database(), std::string_view());
    for (int start = 0; start < 2; ++start) {
      EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }),
                  ::testing::AllOf(HasSubstr("backup"), HasSubstr(folder.string())));
    }
    EXPECT_TRUE(fs::exists(folder / "scene" / "scene.json"));
  }
  WriteWholeFile(database(),
                 std::string_view(reinterpret_cast<const char*>(kept.data()), kept.size()));
  EXPECT_EQ(Open()->FindScan(scan)->folder, folder) << "as the message said";
}

TEST_F(StoreTest, ScansThatAnOlderBackupDoesNotKnowAreSetAsideAndTheirNumbersUsedAgain) {
  std::string patient, old_scan, new_scan;
  std::vector<std::uint8_t> backup;
  {
    const auto store = Open();
    patient = store->AddPatient(kAnna, "A", "");
    old_scan = Scan(*store, patient);
  }
  backup = ReadWholeFile(database(), 1 << 26);
  new_scan = Scan(*Open(), patient);
  for (const char* aside : {"", "-2"}) {
    WriteWholeFile(database(),
                   std::string_view(reinterpret_cast<const char*>(backup.data()), backup.size()));
    const auto store = Open();
    EXPECT_EQ(store->recovery().foreign_folders, 1);
    EXPECT_EQ(store->recovery().orphaned_folders, 0);
    EXPECT_TRUE(
        fs::exists(folder_ / "state" / "set-aside" / (new_scan + aside) / "scene" / "scene.json"));
    EXPECT_FALSE(store->FindScan(old_scan)->folder.empty());
    EXPECT_EQ(Scan(*store, patient), new_scan);
  }
}

TEST_F(StoreTest, FilesThatAreNotOursAreLeftAlone) {
  (void)Open();
  fs::create_directories(folder_ / "state" / "scans" / "lost+found");
  (void)Open();
  EXPECT_TRUE(fs::exists(folder_ / "state" / "scans" / "lost+found"));
}

TEST_F(StoreTest, AScanWhoseFilesAreGoneIsMarkedAndABrokenReferenceIsTold) {
  std::string patient, scan, reference;
  {
    const auto store = Open();
    patient = store->AddPatient(kAnna, "A", "");
    reference = ApprovedReference(*store, patient);
    scan = Scan(*store, patient, reference, kResult);
    for (int i = 0; i < 3; ++i) (void)Scan(*store, patient);
    fs::remove_all(store->ScanFolder(scan));
    fs::remove_all(store->ScanFolder(store->FindReference(reference)->scan_id));
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().lost_scans, 2);
  EXPECT_EQ(store->recovery().broken_references, 1);
  EXPECT_TRUE(store->FindScan(scan)->folder.empty());
  EXPECT_TRUE(store->FindScan(scan)->result) << "the numbers are in the database";
  EXPECT_EQ(store->ApprovedReference(patient)->id, reference);
}

TEST_F(StoreTest, AnApprovedReferenceIsNeverChangedButPlannedAnew) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const std::string first = ApprovedReference(*store, patient);
  web::ReferencePlan plan;
  plan.region_m = {{0, 0}, {1, 0}, {1, 1}};
  plan.isocentre_m = {0.1, 0.2, 0.3};
  const std::string second = store->PlanReference(kAnna, first, 1, plan);
  EXPECT_NE(second, first);
  EXPECT_TRUE(store->FindReference(first)->plan.region_m.empty());
  EXPECT_EQ(store->FindReference(second)->version, 2);
  EXPECT_EQ(store->FindReference(second)->plan.region_m, plan.region_m);
  EXPECT_EQ(store->FindReference(second)->plan.isocentre_m, plan.isocentre_m);
  EXPECT_EQ(store->ApprovedReference(patient)->id, first) << "a draft is compared with by nobody";
  EXPECT_EQ(store->PlanReference(kAnna, second, 1, {}), second);
  store->ApproveReference(kBert, second, 2);
  EXPECT_EQ(store->ApprovedReference(patient)->id, second);
  EXPECT_EQ(store->FindPatient(patient)->approved_reference_id, second);

  Database direct(
      database(),
      Database::Access::kReadWrite);  // not even somebody with the file in hand, by mistake
  EXPECT_THROW(direct.Execute("UPDATE refs SET plan = '{}' WHERE id = " + second),
               ConstraintBroken);
  EXPECT_THROW(direct.Execute("DELETE FROM refs"), ConstraintBroken);
}

TEST_F(StoreTest, NobodyApprovesTheirOwnReference) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const std::string draft = store->AddReference(kAnna, Scan(*store, patient), "", {});
  EXPECT_EQ(RefusalOf([&] { store->ApproveReference(kAnna, draft, 1); }), ChangeResult::kRefused);
  (void)store->PlanReference(kBert, draft, 1, {});
  EXPECT_EQ(RefusalOf([&] { store->PlanReference(kAnna, draft, 1, {}); }), ChangeResult::kConflict)
      << "not what was read";
  EXPECT_EQ(RefusalOf([&] { store->ApproveReference({.user = "carl", .address = {}}, draft, 1); }),
            ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] { store->ApproveReference(kBert, draft, 2); }), ChangeResult::kRefused);
  store->ApproveReference({.user = "carl", .address = {}}, draft, 2);
  EXPECT_EQ(RefusalOf([&] { store->ApproveReference(kBert, draft, 2); }), ChangeResult::kConflict);
}

TEST_F(StoreTest, RefusesWhatMakesNoSense) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  EXPECT_EQ(RefusalOf([&] { (void)store->AddPatient(kAnna, "A", ""); }), ChangeResult::kConflict);
  const std::string running = store->BeginScan({.patient_id = patient,
                                                .reference_id = {},
                                                .purpose = {},
                                                .sensor_serial = {},
                                                .reason = {}});
  EXPECT_EQ(RefusalOf([&] { (void)store->AddReference(kAnna, running, "", {}); }),
            ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] { store->WipePatient(kAnna, patient); }), ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] { store->AcceptScan(kAnna, running); }), ChangeResult::kConflict);
  for (const char* id :
       {"", "0", "-1", "7x", "99", "999999999999999999999", "../1", "1; DROP TABLE scans"}) {
    EXPECT_EQ(RefusalOf([&] { store->WipePatient(kAnna, id); }), ChangeResult::kNotFound) << id;
    EXPECT_EQ(RefusalOf([&] { store->ApproveReference(kAnna, id, 1); }), ChangeResult::kNotFound)
        << id;
    EXPECT_EQ(RefusalOf([&] { store->AcceptScan(kAnna, id); }), ChangeResult::kNotFound) << id;
    EXPECT_EQ(store->FindScan(id), std::nullopt) << id;
    EXPECT_THAT(store->Scans(*id == 0 ? "x" : id, 10), SizeIs(0)) << id;
  }
}

TEST_F(StoreTest, WipingAPatientLeavesNothingButTheAuditEntry) {
  const auto store = Open();
  const std::string keep = store->AddPatient(kAnna, "keep", "");
  const std::string kept = ApprovedReference(*store, keep);
  const std::string patient = store->AddPatient(kAnna, "SECRET-CODE-4711", "thorax");
  const std::string scan = Scan(*store, patient, ApprovedReference(*store, patient), kResult);
  store->WipePatient(kBert, patient);
  EXPECT_EQ(store->FindPatient(patient), std::nullopt);
  EXPECT_EQ(store->FindScan(scan), std::nullopt);
  EXPECT_EQ(store->ApprovedReference(patient), std::nullopt);
  EXPECT_FALSE(fs::exists(store->ScanFolder(scan)));
  EXPECT_EQ(store->ApprovedReference(keep)->id, kept);
  EXPECT_EQ(store->Audit({0, 1}).at(0).action, "patient.wipe");
  EXPECT_EQ(store->Audit({0, 1}).at(0).user, "bert");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "state")) {
    if (!entry.is_regular_file()) continue;
    const auto bytes = ReadWholeFile(entry.path(), 1 << 26);
    EXPECT_EQ(std::string(bytes.begin(), bytes.end()).find("SECRET-CODE-4711"), std::string::npos)
        << entry.path();
  }
}

TEST_F(StoreTest, TheAuditLogOnlyGrows) {
  const auto store = Open();
  (void)store->AddPatient(kAnna, "A", "");
  store->Log(kBert, "login", "bert", "");
  EXPECT_THAT(store->Audit({0, 10}), SizeIs(2));
  EXPECT_EQ(store->Audit({0, 10}).front().action, "login");
  EXPECT_EQ(store->Audit({2, 10}).front().action, "patient.add");
  Database direct(database(), Database::Access::kReadWrite);
  EXPECT_THROW(direct.Execute("DELETE FROM audit"), ConstraintBroken);
  EXPECT_THROW(direct.Execute("UPDATE audit SET user = 'nobody'"), ConstraintBroken);
}

TEST_F(StoreTest, TheLastEnabledEngineerStays) {
  const auto store = Open();
  store->AddUser(
      kAnna,
      {.name = "anna", .role = web::Role::kEngineer, .password_hash = "x", .created_at = {}});
  EXPECT_EQ(RefusalOf([&] {
              store->AddUser(kAnna, {.name = "anna", .password_hash = "y", .created_at = {}});
            }),
            ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] {
              store->ChangeUser(kAnna, {.name = "anna",
                                        .role = web::Role::kTechnician,
                                        .disabled = {},
                                        .password_hash = {},
                                        .expected_hash = {}});
            }),
            ChangeResult::kConflict);
  EXPECT_EQ(store->FindUser("anna")->role, web::Role::kEngineer)
      << "a refused change is rolled back";
  store->AddUser(
      kAnna,
      {.name = "bert", .role = web::Role::kEngineer, .password_hash = "x", .created_at = {}});
  store->ChangeUser(
      kBert,
      {.name = "anna", .role = {}, .disabled = true, .password_hash = {}, .expected_hash = {}});
  EXPECT_TRUE(store->FindUser("anna")->disabled);
  EXPECT_EQ(store->FindUser("anna")->role, web::Role::kEngineer);
}

TEST_F(StoreTest, APasswordChangedMeanwhileDoesNotUndoWhatWasDoneToTheAccount) {
  const auto store = Open();
  for (const char* name : {"anna", "bert"})
    store->AddUser(
        kAnna,
        {.name = name, .role = web::Role::kEngineer, .password_hash = "x", .created_at = {}});
  const web::UserChange password{
      .name = "bert", .role = {}, .disabled = {}, .password_hash = "y", .expected_hash = "x"};
  store->ChangeUser(kAnna, {.name = "bert",
                            .role = web::Role::kTechnician,
                            .disabled = {},
                            .password_hash = {},
                            .expected_hash = {}});
  store->ChangeUser(kBert, password);
  EXPECT_EQ(store->FindUser("bert")->role, web::Role::kTechnician);
  EXPECT_EQ(RefusalOf([&] { store->ChangeUser(kBert, password); }), ChangeResult::kConflict)
      << "not the password that was asked for";
  store->ChangeUser(
      kAnna,
      {.name = "bert", .role = {}, .disabled = true, .password_hash = {}, .expected_hash = {}});
  EXPECT_EQ(RefusalOf([&] {
              store->ChangeUser(kBert, {.name = "bert",
                                        .role = {},
                                        .disabled = {},
                                        .password_hash = "z",
                                        .expected_hash = "y"});
            }),
            ChangeResult::kConflict);
  EXPECT_TRUE(store->FindUser("bert")->disabled);
}

TEST_F(StoreTest, OnlyAScanWithAnAnswerIsAccepted) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const std::string none =
      Scan(*store, patient, reference, R"({"verdict":"no_answer","reasons":["too few markers"]})");
  EXPECT_EQ(RefusalOf([&] { store->AcceptScan(kAnna, none); }), ChangeResult::kConflict);
  const std::string moved = Scan(*store, patient, reference, kResult);
  EXPECT_EQ(RefusalOf([&] { store->AcceptScan(kAnna, moved); }), ChangeResult::kConflict)
      << "outside tolerance without a reason";
  const std::string newer = Scan(*store, patient, reference, kResult);
  EXPECT_EQ(RefusalOf([&] { store->AcceptScan(kAnna, moved, "why"); }), ChangeResult::kConflict)
      << "there is a newer one";
  store->AcceptScan(kAnna, newer, "why");
  const web::AuditEntry logged = store->Audit({0, 1}).at(0);
  EXPECT_EQ(logged.action, "scan.accept_outside");
  EXPECT_THAT(logged.detail, HasSubstr("move, vertical +6.50 mm, lateral -1.00 mm"));
  EXPECT_THAT(logged.detail, HasSubstr("reason: why"));
  const std::string fine = Scan(*store, patient, reference, R"({"verdict":"in_tolerance"})");
  store->AcceptScan(kAnna, fine);
  EXPECT_EQ(store->FindScan(fine)->accepted_by, "anna");
}

TEST_F(StoreTest, OldScansGoAndReferencesStay) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const std::string old = Scan(*store, patient, reference, kResult);
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute("UPDATE scans SET started_at = 0");
  }
  const std::string fresh = Scan(*store, patient, reference, kResult);
  EXPECT_EQ(store->RemoveOldScans(0), 0) << "0: never";
  EXPECT_EQ(store->RemoveOldScans(30), 1);
  EXPECT_EQ(store->FindScan(old), std::nullopt);
  EXPECT_FALSE(fs::exists(store->ScanFolder(old)));
  EXPECT_TRUE(store->FindScan(fresh));
  EXPECT_TRUE(fs::exists(store->ScanFolder(store->FindReference(reference)->scan_id)));
}

TEST_F(StoreTest, AWrongClockMakesNoScanOld) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const std::string first = Scan(*store, patient), with_early_clock = Scan(*store, patient),
                    with_late_clock = Scan(*store, patient);
  const std::string last = Scan(*store, patient);
  const auto stamp = [&](const std::string& scan, const std::string& time) {
    Database(database(), Database::Access::kReadWrite)
        .Execute("UPDATE scans SET started_at = " + time + " WHERE id = " + scan);
  };
  stamp(with_early_clock, "0");
  stamp(with_late_clock, "9000000000000000");
  EXPECT_EQ(store->RemoveOldScans(30), 0);
  for (const std::string& scan : {first, last}) stamp(scan, "1000000");
  EXPECT_EQ(store->RemoveOldScans(30), 4) << "a stamp of the future keeps nothing for ever";
}

TEST_F(StoreTest, CareEndsSoonWhenItIsTold) {
  const auto store = Open();
  (void)Scan(*store, store->AddPatient(kAnna, "A", ""));
  Database(database(), Database::Access::kReadWrite).Execute("UPDATE scans SET started_at = 0");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(store->RemoveOldScans(30, stop.get_token()), 0);
  EXPECT_EQ(store->KeepWithinQuota(0, stop.get_token()), 0);
  EXPECT_EQ(store->KeepWithinQuota(0), 1);
}

TEST_F(StoreTest, AScanWhoseRowTheDiskRefusesIsNoneAndLeavesNothing) {
  std::string patient, id;
  {
    const auto store = Open();
    patient = store->AddPatient(kAnna, "A", "");
  }
  EXPECT_EQ(testing::WriteOnFullDisk(
                200'000,
                [&] {
                  const auto store = Open();
                  const std::string scan = store->BeginScan({.patient_id = patient,
                                                             .reference_id = {},
                                                             .purpose = {},
                                                             .sensor_serial = {},
                                                             .reason = {}});
                  FillStaging(*store, scan);
                  const std::string large(400'000, ' ');  // does not fit
                  EXPECT_THROW(store->FinishScan(scan, {.outcome = web::ScanOutcome::kDone,
                                                        .failure = {},
                                                        .result_json = "{}" + large,
                                                        .swept_area_m2 = 0}),
                               IoError);
                  EXPECT_FALSE(fs::exists(store->ScanFolder(scan)));
                  EXPECT_TRUE(fs::exists(store->StagingFolder(scan)));
                  if (::testing::Test::HasFailure()) throw std::logic_error("see above");
                  store->WipePatient(kAnna, patient);  // it does not run any more
                }),
            testing::WriteOutcome::kDone);
  EXPECT_EQ(Open()->Patients().size(), 0U);
  EXPECT_TRUE(fs::is_empty(folder_ / "state" / "scans"));
}

TEST_F(StoreTest, AScanThatCouldNotBeEndedHasFailedWhenTheNextBegins) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const NewScan scan{
      .patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = {}, .reason = {}};
  const std::string lost = store->BeginScan(scan);
  (void)store->BeginScan(scan);
  EXPECT_EQ(store->FindScan(lost)->outcome, web::ScanOutcome::kFailed);
}

TEST_F(StoreTest, TheQuotaTakesRecordingsFirstThenOldScansAndNeverReferences) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const std::string reference_scan = store->FindReference(reference)->scan_id;
  const std::string old = Scan(*store, patient, reference, kResult),
                    fresh = Scan(*store, patient, reference, kResult);
  for (const std::string& scan : {reference_scan, old, fresh}) {
    fs::create_directory(store->ScanFolder(scan) / "recording");
    WriteWholeFile(store->ScanFolder(scan) / "recording" / "rgb.txt", std::string(1000, 'r'));
    WriteWholeFile(store->ScanFolder(scan) / "scene" / "cloud.ply", std::string(1000, 'c'));
  }
  EXPECT_EQ(store->KeepWithinQuota(7000), 0);
  EXPECT_GT(store->KeepWithinQuota(5100), 0);
  EXPECT_FALSE(fs::exists(store->ScanFolder(reference_scan) / "recording"));
  EXPECT_TRUE(store->FindScan(old));
  (void)store->KeepWithinQuota(2100);
  EXPECT_EQ(store->FindScan(old), std::nullopt);
  EXPECT_TRUE(store->FindScan(fresh));
  (void)store->KeepWithinQuota(0);
  EXPECT_TRUE(fs::exists(store->ScanFolder(reference_scan) / "scene"));
}

TEST_F(StoreTest, ADamagedDatabaseIsToldWithWhatToDo) {
  (void)Open();
  WriteWholeFile(database(), std::string(20000, 'x'));
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }),
              ::testing::AllOf(HasSubstr("plumb.db"), HasSubstr("backup")));
}

TEST_F(StoreTest, ADamagedPageIsFoundAtTheStart) {
  {
    const auto store = Open();
    for (int i = 0; i < 500; ++i)
      store->Log(kAnna, "note", std::to_string(i), std::string(100, 'n'));
  }
  const auto size = fs::file_size(database());
  ASSERT_GT(size, 40000U);
  std::fstream file(database(), std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(static_cast<std::streamoff>(size / 2));
  file << std::string(8192, '\x55');
  file.close();
  EXPECT_THROW((void)Open(), DatabaseCorrupt);
}

TEST_F(StoreTest, ADatabaseOfANewerVersionIsRefused) {
  (void)Open();
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute("PRAGMA user_version = 99");
  }
  EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }), HasSubstr("newer"));
}

// Markers 1 to n in a row, as a check that ended in `status` keeps them.
std::string CheckWith(int n, MarkerCheckStatus status) {
  MarkerBaseline seen{{}, "DICT_6X6_250", 0.104};
  for (int id = 1; id <= n; ++id) {
    SceneMarker marker{.corners = CornersInMarkerFrame(0.104), .num_views = 9, .sigma_m = 0.0005};
    for (Eigen::Vector3d& corner : marker.corners) corner.x() += 0.3 * id;
    seen.markers[id] = marker;
  }
  return CheckJson({.status = status,
                    .items = {{"moved", 1.25, 5.0, "mm", true, "marker 2"}},
                    .reasons = {"because"}},
                   seen);
}

TEST_F(StoreTest, ACheckWithAStampOfTheFutureCountsForNoDay) {
  const auto store = Open();
  Database(database(), Database::Access::kReadWrite)
      .Execute(
          "INSERT INTO checks (time, user, sensor_serial, status, json) VALUES (9000000000000000, "
          "'anna', 'S1', 'passed', '{}')");
  EXPECT_FALSE(store->HasPassedCheckSince(web::WallClock::now()));
}

TEST_F(StoreTest, ACheckOfTheSameDaySensorAndBaselineConfirmsAScanFromBeforeIt) {
  const auto store = Open();
  const std::string patient = store->AddPatient(kAnna, "P-1", "");
  const auto scan = [&](const char* serial) {
    const std::string id = store->BeginScan({.patient_id = patient,
                                             .reference_id = "",
                                             .sensor_serial = serial,
                                             .reason = "",
                                             .check_overdue = true});
    store->FinishScan(
        id, {.outcome = web::ScanOutcome::kFailed, .failure = "of this test", .result_json = ""});
    return id;
  };
  const std::string early = scan("S1");
  const std::string first =
      store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kNoBaseline));
  store->SetCheckBaseline(kBert, first);
  store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_FALSE(store->IsConfirmedByLaterCheck(early)) << "the baseline is younger than the scan";

  const std::string good = scan("S1"), other = scan("S2"), unnamed = scan("");
  EXPECT_FALSE(store->IsConfirmedByLaterCheck(good)) << "the check that passed is older";
  store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_TRUE(store->IsConfirmedByLaterCheck(good));
  EXPECT_FALSE(store->IsConfirmedByLaterCheck(other)) << "another unit";
  EXPECT_FALSE(store->IsConfirmedByLaterCheck(unnamed));
  EXPECT_FALSE(store->IsConfirmedByLaterCheck("none"));

  const std::string doubtful = scan("S1");
  store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kFailed));
  store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_FALSE(store->IsConfirmedByLaterCheck(doubtful)) << "a check failed in between";

  const std::string yesterday = scan("S1");
  store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kPassed));
  EXPECT_TRUE(store->IsConfirmedByLaterCheck(yesterday)) << "still of today";
  Database(database(), Database::Access::kReadWrite)
      .Execute(
          "UPDATE check_baselines SET set_at = 0; UPDATE scans SET started_at = started_at - "
          "86400000000, finished_at = finished_at - 86400000000 WHERE id = " +
          yesterday);
  EXPECT_FALSE(store->IsConfirmedByLaterCheck(yesterday)) << "a check of another day";
}

TEST_F(StoreTest, KeepsDailyChecksAndTheBaselineOverARestart) {
  const auto before = web::WallClock::now() - std::chrono::seconds(1);
  {
    const auto store = Open();
    EXPECT_FALSE(store->CheckBaseline());
    EXPECT_FALSE(BaselineIn(store->CheckBaselineJson()));
    const std::string first =
        store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kNoBaseline));
    EXPECT_FALSE(store->HasPassedCheckSince(before)) << "without a baseline nothing has passed";
    store->SetCheckBaseline(kBert, first);
    store->AddCheck(kAnna, "S1", CheckWith(5, MarkerCheckStatus::kPassed));
  }
  const auto store = Open();
  const std::vector<web::CheckRecord> checks = store->Checks(10);
  ASSERT_THAT(checks, SizeIs(2));
  EXPECT_EQ(checks[0].status, "passed");
  EXPECT_EQ(checks[0].user, "anna");
  EXPECT_EQ(checks[0].sensor_serial, "S1");
  EXPECT_EQ(checks[0].num_markers, 5U);
  ASSERT_THAT(checks[0].items, SizeIs(1));
  EXPECT_EQ(checks[0].items[0].value, 1.25);
  EXPECT_EQ(checks[0].items[0].note, "marker 2");
  EXPECT_EQ(checks[1].reasons, std::vector<std::string>{"because"});
  EXPECT_TRUE(store->HasPassedCheckSince(before));
  EXPECT_FALSE(store->HasPassedCheckSince(web::WallClock::now() + std::chrono::hours(1)));
  EXPECT_TRUE(store->HasPassedCheckSince(before, "S1"));
  EXPECT_FALSE(store->HasPassedCheckSince(before, "S2")) << "another unit was not checked";
  const auto baseline = store->CheckBaseline();
  ASSERT_TRUE(baseline);
  EXPECT_EQ(baseline->check_id, checks[1].id);
  EXPECT_EQ(baseline->set_by, "bert");
  EXPECT_EQ(baseline->num_markers, 4U);
  const auto markers = BaselineIn(store->CheckBaselineJson());
  ASSERT_TRUE(markers);
  EXPECT_EQ(markers->dictionary, "DICT_6X6_250");
  EXPECT_NEAR(markers->markers.at(3).corners[0].x(), 0.9 - 0.052, 1e-12);
  EXPECT_EQ(markers->markers.at(3).num_views, 9);
  std::vector<std::string> actions;
  for (const web::AuditEntry& entry : store->Audit({0, 10}))
    actions.push_back(entry.user + " " + entry.action + " " + entry.detail);
  EXPECT_THAT(actions,
              ::testing::IsSupersetOf({"anna check.done passed", "anna check.done no_baseline",
                                       "bert check.baseline "}));
}

TEST_F(StoreTest, ABaselineNeedsACheckThatSawMarkers) {
  const auto store = Open();
  EXPECT_EQ(RefusalOf([&] { store->SetCheckBaseline(kAnna, "77"); }), ChangeResult::kNotFound);
  EXPECT_EQ(RefusalOf([&] { store->SetCheckBaseline(kAnna, "x"); }), ChangeResult::kNotFound);
  const std::string blind = store->AddCheck(kAnna, "S1", CheckWith(2, MarkerCheckStatus::kFailed));
  EXPECT_EQ(RefusalOf([&] { store->SetCheckBaseline(kBert, blind); }), ChangeResult::kConflict);
  const std::string good =
      store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kNoBaseline));
  EXPECT_EQ(RefusalOf([&] { store->SetCheckBaseline(kAnna, good); }), ChangeResult::kRefused)
      << "not by the person who took it";
  EXPECT_FALSE(store->CheckBaseline());
}

TEST_F(StoreTest, ChecksAreNeverChanged) {
  (void)Open()->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kFailed));
  Database direct(database(), Database::Access::kReadWrite);
  EXPECT_THROW(direct.Execute("UPDATE checks SET status = 'passed'"), ConstraintBroken);
  EXPECT_THROW(direct.Execute("DELETE FROM checks"), ConstraintBroken);
}

TEST_F(StoreTest, AStoreOfTheFirstVersionGetsItsChecks) {
  (void)Open()->AddPatient(kAnna, "P-1", "");
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute(
        "DROP TABLE room_calibrations; DROP TABLE check_baselines; DROP TABLE checks; ALTER TABLE "
        "refs DROP COLUMN revision; "
        "DROP INDEX scans_of_session; ALTER TABLE scans DROP COLUMN session_id; ALTER TABLE scans "
        "DROP COLUMN accepted_reason; ALTER TABLE scans DROP COLUMN accepted_at; ALTER TABLE scans "
        "DROP COLUMN sensor_on_s; ALTER TABLE scans "
        "DROP COLUMN check_overdue; ALTER TABLE scans DROP COLUMN unavailable; ALTER TABLE scans "
        "DROP COLUMN checked_at; ALTER TABLE audit DROP COLUMN chain; DROP TABLE scan_files; DROP "
        "TABLE removed_scans; ALTER TABLE patients DROP COLUMN note; ALTER TABLE patients DROP "
        "COLUMN archived; DROP TABLE templates; DROP TABLE sessions; DROP TABLE displays; DELETE "
        "FROM patients "
        "WHERE id = 0; PRAGMA user_version = 1");
  }
  const auto store = Open();
  EXPECT_THAT(store->Patients(), SizeIs(1));
  EXPECT_THAT(store->Checks(10), SizeIs(0));
  EXPECT_EQ(store->AddCheck(kAnna, "S1", CheckWith(4, MarkerCheckStatus::kFailed)), "1");
}

TEST_F(StoreTest, ATemplateIsOfOneSiteWhateverItsCaseAndIsLogged) {
  {
    const auto store = Open();
    store->SetTemplate(kAnna, {.site = "Thorax",
                               .width_mm = 300,
                               .height_mm = 400,
                               .tolerance = {.shift_mm = 5, .rotation_deg = 2},
                               .changed_by = {}});
    store->SetTemplate(kBert, {.site = "thorax",
                               .width_mm = 320,
                               .height_mm = 410,
                               .tolerance = {.shift_mm = 4, .rotation_deg = 1.5},
                               .changed_by = {}});
  }
  const auto store = Open();
  ASSERT_THAT(store->Templates(), SizeIs(1));
  const web::PlanTemplate stored = store->Templates().at(0);
  EXPECT_EQ(stored.site, "thorax");
  EXPECT_EQ(stored.width_mm, 320);
  EXPECT_EQ(stored.height_mm, 410);
  EXPECT_EQ(stored.tolerance.shift_mm, 4);
  EXPECT_EQ(stored.tolerance.rotation_deg, 1.5);
  EXPECT_EQ(stored.changed_by, "bert");
  EXPECT_THAT(store->Audit({0, 1}).at(0).detail, HasSubstr("320 x 410 mm"));
  EXPECT_EQ(RefusalOf([&] { store->RemoveTemplate(kAnna, "pelvis"); }), ChangeResult::kNotFound);
  store->RemoveTemplate(kAnna, "THORAX");
  EXPECT_THAT(store->Templates(), SizeIs(0));
  for (int i = 0; i < 100; ++i)
    store->SetTemplate(kAnna, {.site = std::to_string(i), .tolerance = {}, .changed_by = {}});
  EXPECT_EQ(RefusalOf([&] {
              store->SetTemplate(kAnna, {.site = "100", .tolerance = {}, .changed_by = {}});
            }),
            ChangeResult::kConflict);
  store->SetTemplate(kAnna, {.site = "99", .tolerance = {}, .changed_by = {}});
}

TEST_F(StoreTest, WhenAResultOfTheSchemaBeforeWasAcceptedIsTakenFromTheLog) {
  std::string accepted, other;
  {
    const auto store = Open();
    const std::string patient = store->AddPatient(kAnna, "P-1", "thorax");
    const std::string reference = ApprovedReference(*store, patient);
    other = Scan(*store, patient, reference, kResult);
    accepted = Scan(*store, patient, reference, kResult);
    store->AcceptScan(kAnna, accepted, "the swelling is known");
  }
  const web::AuditEntry logged = Open()->Audit({0, 1, "scan.accept"}).at(0);
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute("ALTER TABLE scans DROP COLUMN accepted_at; PRAGMA user_version = 7");
  }
  const auto store = Open();
  EXPECT_EQ(store->FindScan(accepted)->accepted_at, logged.time);
  EXPECT_FALSE(store->FindScan(other)->accepted_at);
}

TEST_F(StoreTest, PatientsOfTheSchemaBeforeArchivesKeepWhatTheyHad) {
  const std::string patient = Open()->AddPatient(kAnna, "P-1", "thorax");
  {
    Database direct(database(), Database::Access::kReadWrite);
    direct.Execute(
        "ALTER TABLE scans DROP COLUMN accepted_at; DROP TABLE room_calibrations; ALTER TABLE "
        "patients DROP COLUMN note; ALTER TABLE patients "
        "DROP COLUMN archived; DROP TABLE templates; PRAGMA user_version = 5");
  }
  const auto store = Open();
  ASSERT_THAT(store->Patients(), SizeIs(1));
  EXPECT_EQ(store->FindPatient(patient)->site, "thorax");
  EXPECT_EQ(store->FindPatient(patient)->note, "");
  EXPECT_FALSE(store->FindPatient(patient)->archived);
  store->ChangePatient(kAnna, patient, "thorax", "note");
  EXPECT_EQ(store->FindPatient(patient)->note, "note");
}

TEST_F(StoreTest, ScanNumbersAreNeverUsedTwice) {
  std::string patient, last;
  {
    const auto store = Open();
    patient = store->AddPatient(kAnna, "A", "");
    last = Scan(*store, patient);
    store->WipePatient(kAnna, patient);
  }
  const auto store = Open();
  EXPECT_GT(Scan(*store, store->AddPatient(kAnna, "B", "")), last);
}

}  // namespace
}  // namespace plumb
