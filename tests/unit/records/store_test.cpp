// SPDX-License-Identifier: Apache-2.0
// The rules of the store, and what a crash leaves of a scan.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/schema.hpp"
#include "daemon/database/store_json.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/result_with.hpp"
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

TEST_F(StoreTest, KeepsEverythingOverARestart) {
  std::string patient, scan;
  {
    const auto store = Open();
    patient = store->patients.Add(kAnna, "P-17", "thorax");
    const std::string reference = ApprovedReference(*store, patient);
    scan = Scan(*store, patient, reference, kResult);
    store->scans.Accept(kAnna, scan, "the swelling is known");
    store->settings.Change(kAnna, {.tolerance = {}, .posture = "FFS", .retention_days = 30});
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().interrupted_scans + store->recovery().orphaned_folders +
                store->recovery().lost_scans,
            0);
  const auto found = store->scans.Find(scan);
  ASSERT_TRUE(found && found->result && found->result->correction);
  EXPECT_EQ(found->patient_id, patient);
  EXPECT_EQ(found->accepted_by, "anna");
  EXPECT_EQ(found->accepted_reason, "the swelling is known");
  ASSERT_TRUE(found->accepted_at);
  EXPECT_LT(WallClock::now() - *found->accepted_at, std::chrono::minutes(1));
  EXPECT_EQ(found->result->verdict, Verdict::kMove);
  EXPECT_EQ(found->result->correction->vertical_mm, 6.5);
  EXPECT_EQ(found->result->correction->longitudinal_mm, std::nullopt);
  EXPECT_EQ(found->result->u95->vertical_mm, 1.2);
  EXPECT_EQ(found->folder, store->folders.Scan(scan));
  EXPECT_EQ(store->patients.FindByCode("P-17")->approved_reference_id, found->reference_id);
  EXPECT_EQ(store->settings.Get().posture, "FFS");
  EXPECT_EQ(store->settings.Get().retention_days, 30);
  EXPECT_EQ(store->scans.SweptArea(scan), 2.5);
}

TEST_F(StoreTest, TheFirstSettingsHoldUntilOthersAreSaved) {
  const StoreOptions options{
      .first_settings = {.tolerance = {}, .auto_stop_s = 2.5, .keep_recordings = true}};
  {
    Store store(folder_ / "state", options);
    EXPECT_EQ(store.settings.Get().auto_stop_s, 2.5);
    EXPECT_TRUE(store.settings.Get().keep_recordings);
    store.settings.Change(kAnna, {.tolerance = {}, .auto_stop_s = 7});
  }
  Store store(folder_ / "state", options);
  EXPECT_EQ(store.settings.Get().auto_stop_s, 7);
  EXPECT_FALSE(store.settings.Get().keep_recordings);
}

TEST_F(StoreTest, AScanThatWasRunningAtACrashHasFailedAndLeavesNothing) {
  std::string patient, id;
  {
    const auto store = Open();
    patient = store->patients.Add(kAnna, "A", "");
    id = store->scans.Begin(
        {.patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = {}});
    FillStaging(*store, id);
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().interrupted_scans, 1);
  EXPECT_EQ(store->scans.Find(id)->outcome, ScanOutcome::kFailed);
  EXPECT_THAT(store->scans.Find(id)->failure.English(), HasSubstr("interrupted"));
  EXPECT_TRUE(fs::is_empty(folder_ / "state" / "scans"));
}

TEST_F(StoreTest, ScansOfALostDatabaseAreNeverTakenForOrphans) {
  std::string scan;
  {
    const auto store = Open();
    scan = Scan(*store, store->patients.Add(kAnna, "A", ""));
  }
  const fs::path folder = folder_ / "state" / "scans" / scan;
  const std::vector<std::uint8_t> kept = ReadWholeFile(database(), 1 << 26);
  for (const bool is_empty : {false, true}) {
    RemoveDatabase();
    if (is_empty) WriteWholeFile(database(), std::string_view());
    for (int start = 0; start < 2; ++start) {
      EXPECT_THAT(MessageOf<DatabaseCorrupt>([&] { (void)Open(); }),
                  ::testing::AllOf(HasSubstr("backup"), HasSubstr(folder.string())));
    }
    EXPECT_TRUE(fs::exists(folder / "scene" / "scene.json"));
  }
  RemoveDatabase();
  WriteWholeFile(database(),
                 std::string_view(reinterpret_cast<const char*>(kept.data()), kept.size()));
  EXPECT_EQ(Open()->scans.Find(scan)->folder, folder) << "as the message said";
}

TEST_F(StoreTest, ScansThatAnOlderBackupDoesNotKnowAreSetAsideAndTheirNumbersStayTheirs) {
  std::string patient, old_scan, new_scan;
  std::vector<std::uint8_t> backup;
  {
    const auto store = Open();
    patient = store->patients.Add(kAnna, "A", "");
    old_scan = Scan(*store, patient);
  }
  backup = ReadWholeFile(database(), 1 << 26);
  new_scan = Scan(*Open(), patient);
  for (int i = 0; i < 2; ++i) {
    for (const char* beside : {"plumb.db-mark", "plumb.db-seals"})
      fs::remove(folder_ / "state" / beside);  // as a restore leaves it
    WriteWholeFile(database(),
                   std::string_view(reinterpret_cast<const char*>(backup.data()), backup.size()));
    const auto store = Open();
    EXPECT_EQ(store->recovery().foreign_folders, 1);
    EXPECT_EQ(store->recovery().orphaned_folders, 0);
    EXPECT_TRUE(fs::exists(folder_ / "state" / "set-aside" / new_scan / "scene" / "scene.json"));
    EXPECT_FALSE(store->scans.Find(old_scan)->folder.empty());
    const std::string next = Scan(*store, patient);
    EXPECT_GT(next, new_scan) << "which may be printed on a report";
    new_scan = next;
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
    patient = store->patients.Add(kAnna, "A", "");
    reference = ApprovedReference(*store, patient);
    scan = Scan(*store, patient, reference, kResult);
    for (int i = 0; i < 3; ++i) (void)Scan(*store, patient);
    fs::remove_all(store->folders.Scan(scan));
    fs::remove_all(store->folders.Scan(store->references.Find(reference)->scan_id));
  }
  const auto store = Open();
  EXPECT_EQ(store->recovery().lost_scans, 2);
  EXPECT_EQ(store->recovery().broken_references, 1);
  EXPECT_TRUE(store->scans.Find(scan)->folder.empty());
  EXPECT_TRUE(store->scans.Find(scan)->result) << "the numbers are in the database";
  EXPECT_EQ(store->references.Approved(patient)->id, reference);
}

TEST_F(StoreTest, AnApprovedReferenceIsNeverChangedButPlannedAnew) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string first = ApprovedReference(*store, patient);
  ReferencePlan plan;
  plan.region_m = {{0, 0}, {1, 0}, {1, 1}};
  plan.isocentre_m = {0.1, 0.2, 0.3};
  const std::string second = store->references.Plan(kAnna, first, 2, plan);
  EXPECT_NE(second, first);
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).detail.English(), PlanJson({}) + "\n" + PlanJson(plan));
  EXPECT_TRUE(store->references.Find(first)->plan.region_m.empty());
  EXPECT_EQ(store->references.Find(second)->version, 2);
  EXPECT_EQ(store->references.Find(second)->plan.region_m, plan.region_m);
  EXPECT_EQ(store->references.Find(second)->plan.isocentre_m, plan.isocentre_m);
  EXPECT_EQ(store->references.Approved(patient)->id, first) << "a draft is compared with by nobody";
  EXPECT_EQ(store->references.Plan(kAnna, second, 1, {}), second);
  store->references.Approve(kBert, second, 2);
  EXPECT_EQ(store->references.Approved(patient)->id, second);
  EXPECT_EQ(store->patients.Find(patient)->approved_reference_id, second);

  Database direct(
      database(),
      Database::Access::kReadWrite);  // not even somebody with the file in hand, by mistake
  EXPECT_THROW(direct.Execute("UPDATE refs SET plan = '{}' WHERE id = " + second),
               ConstraintBroken);
  EXPECT_THROW(direct.Execute("DELETE FROM refs"), ConstraintBroken);
}

TEST_F(StoreTest, NobodyApprovesTheirOwnReference) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string draft = store->references.Add(kAnna, Scan(*store, patient), "", {});
  EXPECT_EQ(RefusalOf([&] { store->references.Approve(kBert, draft, 1); }), ChangeResult::kConflict)
      << "nobody has planned it";
  (void)store->references.Plan(kBert, draft, 1, {});
  EXPECT_EQ(RefusalOf([&] { store->references.Plan(kAnna, draft, 1, {}); }),
            ChangeResult::kConflict)
      << "not what was read";
  EXPECT_EQ(
      RefusalOf([&] { store->references.Approve({.user = "carl", .address = {}}, draft, 1); }),
      ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] { store->references.Approve(kBert, draft, 2); }), ChangeResult::kRefused);
  store->references.Approve({.user = "carl", .address = {}}, draft, 2);
  EXPECT_EQ(RefusalOf([&] { store->references.Approve(kBert, draft, 2); }),
            ChangeResult::kConflict);
}

TEST_F(StoreTest, RefusesWhatMakesNoSense) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  EXPECT_EQ(RefusalOf([&] { (void)store->patients.Add(kAnna, "A", ""); }), ChangeResult::kConflict);
  const std::string running = store->scans.Begin(
      {.patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = {}});
  EXPECT_EQ(RefusalOf([&] { (void)store->references.Add(kAnna, running, "", {}); }),
            ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] { store->removal.WipePatient(kAnna, patient); }),
            ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] { store->scans.Accept(kAnna, running); }), ChangeResult::kConflict);
  for (const char* id :
       {"", "0", "-1", "7x", "99", "999999999999999999999", "../1", "1; DROP TABLE scans"}) {
    EXPECT_EQ(RefusalOf([&] { store->removal.WipePatient(kAnna, id); }), ChangeResult::kNotFound)
        << id;
    EXPECT_EQ(RefusalOf([&] { store->references.Approve(kAnna, id, 1); }), ChangeResult::kNotFound)
        << id;
    EXPECT_EQ(RefusalOf([&] { store->scans.Accept(kAnna, id); }), ChangeResult::kNotFound) << id;
    EXPECT_EQ(store->scans.Find(id), std::nullopt) << id;
    EXPECT_THAT(store->scans.List(*id == 0 ? "x" : id, 10), SizeIs(0)) << id;
  }
}

TEST_F(StoreTest, WipingAPatientLeavesNothingButTheAuditEntry) {
  const auto store = Open();
  const std::string keep = store->patients.Add(kAnna, "keep", "");
  const std::string kept = ApprovedReference(*store, keep);
  const std::string patient = store->patients.Add(kAnna, "SECRET-CODE-4711", "thorax");
  const std::string scan = Scan(*store, patient, ApprovedReference(*store, patient), kResult);
  store->removal.WipePatient(kBert, patient);
  EXPECT_EQ(store->patients.Find(patient), std::nullopt);
  EXPECT_EQ(store->scans.Find(scan), std::nullopt);
  EXPECT_EQ(store->references.Approved(patient), std::nullopt);
  EXPECT_FALSE(fs::exists(store->folders.Scan(scan)));
  EXPECT_EQ(store->references.Approved(keep)->id, kept);
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).action, "patient.wipe");
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).user, "bert");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "state")) {
    if (!entry.is_regular_file()) continue;
    const auto bytes = ReadWholeFile(entry.path(), 1 << 26);
    EXPECT_EQ(std::string(bytes.begin(), bytes.end()).find("SECRET-CODE-4711"), std::string::npos)
        << entry.path();
  }
}

TEST_F(StoreTest, TheAuditLogOnlyGrows) {
  const auto store = Open();
  (void)store->patients.Add(kAnna, "A", "");
  store->audit.Log(kBert, "login", "bert", "");
  EXPECT_THAT(store->audit.Find({0, 10}), SizeIs(2));
  EXPECT_EQ(store->audit.Find({0, 10}).front().action, "login");
  EXPECT_EQ(store->audit.Find({2, 10}).front().action, "patient.add");
  Database direct(database(), Database::Access::kReadWrite);
  EXPECT_THROW(direct.Execute("DELETE FROM audit"), ConstraintBroken);
  EXPECT_THROW(direct.Execute("UPDATE audit SET user = 'nobody'"), ConstraintBroken);
}

TEST_F(StoreTest, TheLastEnabledEngineerStays) {
  const auto store = Open();
  store->users.Add(
      kAnna, {.name = "anna", .role = Role::kEngineer, .password_hash = "x", .created_at = {}});
  EXPECT_EQ(RefusalOf([&] {
              store->users.Add(kAnna, {.name = "anna", .password_hash = "y", .created_at = {}});
            }),
            ChangeResult::kConflict);
  EXPECT_EQ(RefusalOf([&] {
              store->users.Change(kAnna, {.name = "anna",
                                          .role = Role::kTechnician,
                                          .disabled = {},
                                          .password_hash = {},
                                          .expected_hash = {}});
            }),
            ChangeResult::kConflict);
  EXPECT_EQ(store->users.Find("anna")->role, Role::kEngineer) << "a refused change is rolled back";
  store->users.Add(
      kAnna, {.name = "bert", .role = Role::kEngineer, .password_hash = "x", .created_at = {}});
  store->users.Change(
      kBert,
      {.name = "anna", .role = {}, .disabled = true, .password_hash = {}, .expected_hash = {}});
  EXPECT_TRUE(store->users.Find("anna")->disabled);
  EXPECT_EQ(store->users.Find("anna")->role, Role::kEngineer);
}

void AddTwoEngineers(Store& store) {
  for (const char* name : {"anna", "bert"})
    store.users.Add(
        kAnna, {.name = name, .role = Role::kEngineer, .password_hash = "x", .created_at = {}});
}

TEST_F(StoreTest, WhatAPersonChoseOfThePageStays) {
  {
    const auto store = Open();
    AddTwoEngineers(*store);
    store->users.SetPreferences("bert", {.language = "es", .theme = "light"});
    EXPECT_EQ(RefusalOf([&] {
                store->users.SetPreferences("couch side", {"es", "light"});
              }),
              ChangeResult::kNotFound);
  }
  const auto store = Open();
  EXPECT_EQ(store->users.PreferencesOf("bert").language, "es");
  EXPECT_EQ(store->users.PreferencesOf("bert").theme, "light");
  EXPECT_EQ(store->users.PreferencesOf("anna").language, "");
}

TEST_F(StoreTest, APasswordChangedMeanwhileDoesNotUndoWhatWasDoneToTheAccount) {
  const auto store = Open();
  AddTwoEngineers(*store);
  const UserChange password{
      .name = "bert", .role = {}, .disabled = {}, .password_hash = "y", .expected_hash = "x"};
  store->users.Change(kAnna, {.name = "bert",
                              .role = Role::kTechnician,
                              .disabled = {},
                              .password_hash = {},
                              .expected_hash = {}});
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).detail.English(), "role engineer > technician");
  store->users.Change(kBert, password);
  EXPECT_EQ(store->users.Find("bert")->role, Role::kTechnician);
  EXPECT_EQ(RefusalOf([&] { store->users.Change(kBert, password); }), ChangeResult::kConflict)
      << "not the password that was asked for";
  store->users.Change(
      kAnna,
      {.name = "bert", .role = {}, .disabled = true, .password_hash = {}, .expected_hash = {}});
  EXPECT_EQ(RefusalOf([&] {
              store->users.Change(kBert, {.name = "bert",
                                          .role = {},
                                          .disabled = {},
                                          .password_hash = "z",
                                          .expected_hash = "y"});
            }),
            ChangeResult::kConflict);
  EXPECT_TRUE(store->users.Find("bert")->disabled);
}

TEST_F(StoreTest, OnlyAScanWithAnAnswerIsAccepted) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const std::string none =
      Scan(*store, patient, reference,
           testing::ResultWith(R"({"verdict":"no_answer","reasons":["too few markers"]})"));
  EXPECT_EQ(RefusalOf([&] { store->scans.Accept(kAnna, none); }), ChangeResult::kConflict);
  const std::string moved = Scan(*store, patient, reference, kResult);
  EXPECT_EQ(RefusalOf([&] { store->scans.Accept(kAnna, moved); }), ChangeResult::kConflict)
      << "outside tolerance without a reason";
  const std::string newer = Scan(*store, patient, reference, kResult);
  EXPECT_EQ(RefusalOf([&] { store->scans.Accept(kAnna, moved, "why"); }), ChangeResult::kConflict)
      << "there is a newer one";
  store->scans.Accept(kAnna, newer, "why");
  const AuditEntry logged = store->audit.Find({0, 1}).at(0);
  EXPECT_EQ(logged.action, "scan.accept_outside");
  EXPECT_THAT(logged.detail.English(), HasSubstr("move, vertical +6.50 mm, lateral -1.00 mm"));
  EXPECT_THAT(logged.detail.English(), HasSubstr("reason: why"));
  const std::string fine =
      Scan(*store, patient, reference, testing::ResultWith(R"({"verdict":"in_tolerance"})"));
  store->scans.Accept(kAnna, fine);
  EXPECT_EQ(store->scans.Find(fine)->accepted_by, "anna");
}

TEST_F(StoreTest, WhatWasAcceptedIsForTheArchiveUntilItHasIt) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string reference = ApprovedReference(*store, patient);
  const auto before = WallClock::now();
  const auto in_tolerance = testing::ResultWith(R"({"verdict":"in_tolerance"})");
  const std::string first = Scan(*store, patient, reference, in_tolerance);
  EXPECT_THAT(store->scans.ToArchive(before), ::testing::IsEmpty()) << "nobody accepted it";
  store->scans.Accept(kAnna, first);
  const auto between = WallClock::now();
  const std::string second = Scan(*store, patient, reference, in_tolerance);
  store->scans.Accept(kAnna, second);
  EXPECT_THAT(store->scans.ToArchive(before), ::testing::ElementsAre(first, second));
  EXPECT_THAT(store->scans.ToArchive(between), ::testing::ElementsAre(second));
  store->scans.NoteArchived(first, "PACS@10.0.0.5:104");
  EXPECT_THAT(store->scans.ToArchive(before), ::testing::ElementsAre(second));
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).action, "scan.archived");
  store->scans.NoteArchived("000999", "PACS@10.0.0.5:104");
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).subject, first) << "one that is not there any more";
}

TEST_F(StoreTest, AResultIsNotAcceptedAfterItsReferenceWasReplaced) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string first = ApprovedReference(*store, patient);
  const std::string scan =
      Scan(*store, patient, first, testing::ResultWith(R"({"verdict":"in_tolerance"})"));
  const std::string second = store->references.Plan(kAnna, first, 2, {});
  store->references.Approve(kBert, second, 1);
  EXPECT_EQ(RefusalOf([&] { store->scans.Accept(kAnna, scan); }), ChangeResult::kConflict);
  EXPECT_EQ(store->scans.Find(scan)->accepted_by, "");
  const std::string again =
      Scan(*store, patient, second, testing::ResultWith(R"({"verdict":"in_tolerance"})"));
  store->scans.Accept(kAnna, again);
  EXPECT_EQ(store->scans.Find(again)->accepted_by, "anna");
}

TEST_F(StoreTest, AnOlderDraftIsNotApprovedAfterANewerOne) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "A", "");
  const std::string first = ApprovedReference(*store, patient);
  const std::string older = store->references.Plan(kAnna, first, 2, {});
  const std::string newer = store->references.Plan(kAnna, first, 2, {});
  ASSERT_NE(older, newer);
  store->references.Approve(kBert, newer, 1);
  EXPECT_EQ(RefusalOf([&] { store->references.Approve(kBert, older, 1); }),
            ChangeResult::kConflict);
  EXPECT_EQ(store->references.Find(older)->approved_by, "");
  EXPECT_EQ(store->references.Approved(patient)->id, newer);
}

TEST_F(StoreTest, AScanWithoutAPatientCannotBecomeAReference) {
  const auto store = Open();
  const std::string scan = Scan(*store, "");
  EXPECT_EQ(RefusalOf([&] { (void)store->references.Add(kAnna, scan, "first", {}); }),
            ChangeResult::kConflict);
  store->removal.RemoveScan(kAnna, scan, "scanned without a patient");
  EXPECT_FALSE(store->scans.Find(scan)) << "it can still be removed";
}

TEST_F(StoreTest, ATemplateIsOfOneSiteWhateverItsCaseAndIsLogged) {
  {
    const auto store = Open();
    store->templates.Set(kAnna, {.site = "Thorax",
                                 .width_mm = 300,
                                 .height_mm = 400,
                                 .tolerance = {.shift_mm = 5, .rotation_deg = 2},
                                 .changed_by = {}});
    store->templates.Set(kBert, {.site = "thorax",
                                 .width_mm = 320,
                                 .height_mm = 410,
                                 .tolerance = {.shift_mm = 4, .rotation_deg = 1.5},
                                 .changed_by = {}});
  }
  const auto store = Open();
  ASSERT_THAT(store->templates.List(), SizeIs(1));
  const PlanTemplate stored = store->templates.List().at(0);
  EXPECT_EQ(stored.site, "thorax");
  EXPECT_EQ(stored.width_mm, 320);
  EXPECT_EQ(stored.height_mm, 410);
  EXPECT_EQ(stored.tolerance.shift_mm, 4);
  EXPECT_EQ(stored.tolerance.rotation_deg, 1.5);
  EXPECT_EQ(stored.changed_by, "bert");
  EXPECT_EQ(store->audit.Find({0, 1}).at(0).detail.English(),
            "thorax: region 320 x 410 mm, tolerance 4 mm and 1.5 degrees; before: region 300 x 400 "
            "mm, tolerance 5 mm and 2 degrees");
  EXPECT_EQ(stored.posture, "");
  PlanTemplate more = stored;
  more.posture = "FFS";
  more.hint = "from the feet";
  store->templates.Set(kAnna, more);
  EXPECT_EQ(store->templates.List().at(0).posture, "FFS");
  EXPECT_EQ(store->templates.List().at(0).hint, "from the feet");
  EXPECT_THAT(store->audit.Find({0, 1}).at(0).detail.English(),
              HasSubstr("1.5 degrees, posture FFS, hint \u201cfrom the feet\u201d; before:"));
  EXPECT_EQ(RefusalOf([&] { store->templates.Remove(kAnna, "pelvis"); }), ChangeResult::kNotFound);
  store->templates.Remove(kAnna, "THORAX");
  EXPECT_THAT(store->templates.List(), SizeIs(0));
  for (int i = 0; i < 100; ++i)
    store->templates.Set(kAnna, {.site = std::to_string(i), .tolerance = {}, .changed_by = {}});
  EXPECT_EQ(RefusalOf([&] {
              store->templates.Set(kAnna, {.site = "100", .tolerance = {}, .changed_by = {}});
            }),
            ChangeResult::kConflict);
  store->templates.Set(kAnna, {.site = "99", .tolerance = {}, .changed_by = {}});
}

TEST_F(StoreTest, ScanNumbersAreNeverUsedTwice) {
  std::string patient, last;
  {
    const auto store = Open();
    patient = store->patients.Add(kAnna, "A", "");
    last = Scan(*store, patient);
    store->removal.WipePatient(kAnna, patient);
  }
  const auto store = Open();
  EXPECT_GT(Scan(*store, store->patients.Add(kAnna, "B", "")), last);
}

}  // namespace
}  // namespace plumb
