// The rules of the store, and what a crash leaves of a scan.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/records/schema.hpp"
#include "tests/support/message_of.hpp"
#include "tests/unit/records/store_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::kAnna;
using testing::kBert;
using testing::kResult;
using testing::MessageOf;
using ::testing::SizeIs;
using testing::StoreTest;
using web::ChangeResult;

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
