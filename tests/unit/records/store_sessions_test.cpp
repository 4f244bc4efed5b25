// SPDX-License-Identifier: Apache-2.0
// Treatment sessions, patients and waiting references in the store.
#include <filesystem>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/database/stored_values.hpp"
#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/refusal_of.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::IsEmpty;
using testing::kAnna;
using testing::kBert;
using ::testing::SizeIs;

class StoreSessionsTest : public ::testing::Test {
 protected:
  static std::string Scan(Store& store, const std::string& patient, const std::string& session,
                          const std::string& result = "") {
    const std::string id = store.scans.Begin({.patient_id = patient,
                                              .reference_id = {},
                                              .purpose = ScanPurpose::kFraction,
                                              .sensor_serial = "S1",
                                              .session_id = session,
                                              .sensor_on_s = 90.0,
                                              .daily_check = DailyCheck::kFailed});
    fs::create_directories(store.folders.Staging(id) / "scene");
    WriteWholeFile(store.folders.Staging(id) / "scene" / "scene.json", std::string_view("{}"));
    store.scans.Finish(
        id, {.outcome = ScanOutcome::kDone, .result_json = result, .swept_area_m2 = 1.0});
    return id;
  }

  testing::TempFolder folder_;
};

TEST_F(StoreSessionsTest, TheHintOfTheSitesTemplateIsSaid) {
  Store store(folder_ / "state");
  store.templates.Set(kAnna, {.site = "Thorax",
                              .tolerance = {},
                              .changed_by = {},
                              .posture = "HFS",
                              .hint = "begin at the feet"});
  store.treatments.Open(kAnna, store.patients.Add(kAnna, "P-1", "THORAX"), ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->sweep_hint, "begin at the feet");
  store.treatments.CloseAll(kAnna);
  store.treatments.Open(kAnna, store.patients.Add(kAnna, "P-2", "pelvis"), ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->sweep_hint, "");
}

TEST_F(StoreSessionsTest, OneIsOpenAtATime) {
  Store store(folder_ / "state");
  const std::string a = store.patients.Add(kAnna, "P-1", ""),
                    b = store.patients.Add(kAnna, "P-2", "");
  EXPECT_FALSE(store.treatments.Opened());
  const std::string first = store.treatments.Open(kAnna, a, ScanPurpose::kFraction);
  ASSERT_TRUE(store.treatments.Opened());
  EXPECT_EQ(store.treatments.Opened()->patient_code, "P-1");
  EXPECT_EQ(store.treatments.Opened()->opened_by, "anna");
  EXPECT_EQ(store.treatments.Opened()->language, "");
  store.users.Add(kBert, {"anna", Role::kTechnician, "$hash", false, WallClock::now()});
  store.users.SetPreferences("anna", {.language = "es", .theme = "dark"});
  EXPECT_EQ(store.treatments.Opened()->language, "es") << "of the person who opened it";
  const std::string second = store.treatments.Open(kBert, b, ScanPurpose::kReference);
  EXPECT_NE(first, second);
  EXPECT_EQ(store.treatments.Opened()->id, second);
  EXPECT_EQ(store.treatments.Opened()->fraction, 0);
  store.treatments.CloseAll(kBert);
  EXPECT_FALSE(store.treatments.Opened());
  EXPECT_EQ(RefusalOf([&] { (void)store.treatments.Open(kAnna, "99", ScanPurpose::kFraction); }),
            ChangeResult::kNotFound);
}

TEST_F(StoreSessionsTest, ASessionKeepsTheReferenceThatItWasOpenedWithUntilAPersonChangesIt) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string first = testing::PlanAndApprove(
      store, store.references.Add(kAnna, testing::StoreScan(store, patient), "", {}));
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->reference, (ReferenceVersion{first, 1}));
  EXPECT_EQ(store.treatments.Opened()->reference_created_at,
            store.references.Find(first)->created_at);
  EXPECT_FALSE(store.treatments.Opened()->newer_reference);
  const std::string second = store.references.Plan(kAnna, first, 2, {});
  EXPECT_FALSE(store.treatments.Opened()->newer_reference) << "a draft is none";
  store.references.Approve(kBert, second, 1);
  EXPECT_EQ(store.references.OfSession(session)->id, first);
  EXPECT_EQ(store.treatments.Opened()->reference, (ReferenceVersion{first, 1}));
  EXPECT_EQ(store.treatments.Opened()->newer_reference, (ReferenceVersion{second, 2}));
  const auto use = [&](const std::string& which, const std::string& reference) {
    return RefusalOf([&] { store.treatments.UseReference(kAnna, which, reference); });
  };
  EXPECT_EQ(use(session, first), ChangeResult::kConflict) << "not the newest";
  EXPECT_EQ(use("99", second), ChangeResult::kConflict) << "no such session";
  EXPECT_EQ(use(session, second), ChangeResult::kDone);
  EXPECT_EQ(store.references.OfSession(session)->id, second);
  EXPECT_FALSE(store.treatments.Opened()->newer_reference);
  const AuditEntry logged = store.audit.Find({0, 1}).at(0);
  EXPECT_EQ(logged.action, "session.reference");
  EXPECT_EQ(logged.subject, session);
  EXPECT_EQ(logged.detail.English(), "version 2, captured surface");
  store.treatments.CloseAll(kAnna);
  EXPECT_EQ(use(session, second), ChangeResult::kConflict) << "closed";
}

TEST_F(StoreSessionsTest, APersonChoosesBetweenThePlanningCtAndTheCapturedSurface) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const auto approved = [&](ReferenceSource source) {
    return testing::PlanAndApprove(
        store, store.references.Add(kAnna, testing::StoreScan(store, patient), "", {},
                                    {.source = source}));
  };
  const std::string planned = approved(ReferenceSource::kPlanningCt);
  const ReferenceVersion ct{planned, 1, ReferenceSource::kPlanningCt};
  EXPECT_EQ(store.references.Find(planned)->origin.source, ReferenceSource::kPlanningCt);
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->reference, ct);
  EXPECT_FALSE(store.treatments.Opened()->other_reference);
  const std::string captured = approved(ReferenceSource::kSweep);
  const ReferenceVersion surface{captured, 2, ReferenceSource::kSweep};
  EXPECT_EQ(store.treatments.Opened()->newer_reference, surface);
  EXPECT_EQ(store.treatments.Opened()->other_reference, surface);

  store.treatments.UseReference(kAnna, session, captured);
  EXPECT_EQ(store.references.OfSession(session)->id, captured);
  EXPECT_EQ(store.treatments.Opened()->other_reference, ct);
  store.treatments.UseReference(kBert, session, planned);
  EXPECT_EQ(store.references.OfSession(session)->id, planned);
  EXPECT_EQ(store.treatments.Opened()->reference, ct);
  EXPECT_FALSE(store.treatments.Opened()->newer_reference) << "it was passed over on purpose";
  const AuditEntry logged = store.audit.Find({0, 1}).at(0);
  EXPECT_EQ(logged.action, "session.reference");
  EXPECT_EQ(logged.detail.English(), "version 1, planning CT");

  // A change of its plan is a newer one of the same source, and a question again.
  const std::string second = store.references.Plan(kAnna, planned, 2, {});
  store.references.Approve(kBert, second, 1);
  EXPECT_EQ(store.treatments.Opened()->newer_reference,
            (ReferenceVersion{second, 3, ReferenceSource::kPlanningCt}));
  EXPECT_EQ(RefusalOf([&] { store.treatments.UseReference(kAnna, session, planned); }),
            ChangeResult::kConflict)
      << "not the newest of its source";
  EXPECT_EQ(RefusalOf([&] { store.treatments.UseReference(kAnna, session, captured); }),
            ChangeResult::kDone);
  // The next session begins with the newest again.
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->reference->id, second);
}

TEST_F(StoreSessionsTest, FractionNumbersCountSessionsNotScans) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string first = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 1);
  const std::string moved =
      Scan(store, patient, first, testing::ResultWith(R"({"verdict":"move"})"));
  const std::string right =
      Scan(store, patient, first, testing::ResultWith(R"({"verdict":"in_tolerance"})"));
  EXPECT_EQ(store.treatments.Opened()->num_scans, 2);
  EXPECT_EQ(store.scans.Find(moved)->fraction, 1);
  EXPECT_EQ(store.scans.Find(right)->fraction, 1);
  EXPECT_EQ(store.scans.Find(right)->session_id, first);
  EXPECT_EQ(store.scans.Find(right)->sensor_on_s, 90.0);
  EXPECT_EQ(store.scans.Find(right)->daily_check, DailyCheck::kFailed);
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 2);
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 2) << "nothing was scanned in the session before";
}

TEST_F(StoreSessionsTest, AClosedSessionGoesOnWithItsFractionOnTheSameDay) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string empty = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  store.treatments.CloseAll(kSelf);
  EXPECT_FALSE(store.patients.Find(patient)->last_session) << "nothing was scanned in it";
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  const std::string scan =
      Scan(store, patient, session, testing::ResultWith(R"({"verdict":"move"})"));
  EXPECT_TRUE(store.treatments.Opened()->has_unaccepted);
  EXPECT_FALSE(store.patients.Find(patient)->last_session) << "it is open";
  store.treatments.CloseAll(kSelf);  // as after a power cut
  ASSERT_TRUE(store.patients.Find(patient)->last_session);
  EXPECT_EQ(store.patients.Find(patient)->last_session->id, session);
  EXPECT_EQ(store.patients.Find(patient)->last_session->fraction, 1);
  const auto resume = [&](const std::string& which) {
    return RefusalOf([&] { store.treatments.Resume(kBert, which); });
  };
  EXPECT_EQ(resume(empty), ChangeResult::kConflict) << "not the newest";
  EXPECT_EQ(resume("99"), ChangeResult::kConflict);
  EXPECT_EQ(resume(session), ChangeResult::kDone);
  EXPECT_EQ(store.treatments.Opened()->id, session);
  EXPECT_EQ(store.treatments.Opened()->fraction, 1);
  EXPECT_EQ(store.treatments.Opened()->opened_by, "bert");
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "session.resume");
  const auto close_before = [&](std::int64_t seconds) {
    store.treatments.CloseAll(kAnna);
    store.database().ForChanges()->Run(
        "UPDATE sessions SET closed_at = closed_at - ? WHERE id = CAST(? AS INTEGER)",
        seconds * 1'000'000, session);
  };
  close_before(std::int64_t{kResumable_h} * 3600 - 60);
  EXPECT_EQ(resume(session), ChangeResult::kDone);
  close_before(std::int64_t{kResumable_h} * 3600 + 1);
  EXPECT_EQ(resume(session), ChangeResult::kConflict) << "too long ago";
  EXPECT_EQ(store.scans.Find(scan)->fraction, 1);
}

TEST_F(StoreSessionsTest, ASessionWhoseOnlySweepWasCutOffGoesOnAndAnEmptyOneHidesNone) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  (void)store.scans.Begin({.patient_id = patient,
                           .reference_id = {},
                           .purpose = ScanPurpose::kFraction,
                           .sensor_serial = "S1",
                           .session_id = session,
                           .sensor_on_s = 90.0,
                           .daily_check = DailyCheck::kPassed});
  store.treatments.CloseAll(kSelf);
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);  // by mistake
  store.treatments.CloseAll(kAnna);
  const auto last = store.patients.Find(patient)->last_session;
  ASSERT_TRUE(last);
  EXPECT_EQ(last->id, session);
  EXPECT_EQ(last->num_scans, 0) << "none was completed";
  EXPECT_EQ(RefusalOf([&] { store.treatments.Resume(kBert, session); }), ChangeResult::kDone);
}

TEST_F(StoreSessionsTest, AFractionNumberIsCorrectedForAReasonAndTheNextFollowsIt) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string reference = store.treatments.Open(kAnna, patient, ScanPurpose::kReference);
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  const std::string scan =
      Scan(store, patient, session, testing::ResultWith(R"({"verdict":"move"})"));
  store.treatments.CorrectFraction(kAnna, session, 3, "two were given elsewhere");
  EXPECT_EQ(store.scans.Find(scan)->fraction, 3);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(),
            "from 1 to 3; reason: two were given elsewhere");
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 4);
  for (const std::string& none : {reference, std::string("99")})
    EXPECT_EQ(RefusalOf([&] { store.treatments.CorrectFraction(kAnna, none, 2, "why"); }),
              ChangeResult::kNotFound);
}

TEST_F(StoreSessionsTest, FractionNumbersContinueAfterScansWereRemoved) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  std::vector<std::string> scans;
  for (int fraction = 1; fraction <= 4; ++fraction) {
    const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
    EXPECT_EQ(store.treatments.Opened()->fraction, fraction);
    scans.push_back(Scan(store, patient, session, testing::ResultWith(R"({"verdict":"move"})")));
  }
  for (std::size_t i = 0; i < 3; ++i) store.removal.RemoveScan(kAnna, scans[i], "room on the disk");
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 5);
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 5) << "nothing was scanned in the session before";
  (void)store.treatments.Open(kAnna, store.patients.Add(kAnna, "P-2", ""), ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 1) << "each patient's own";
}

TEST_F(StoreSessionsTest, ADiscardedScanHasNoResultAndIsNotAFraction) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  for (const ScanOutcome outcome : {ScanOutcome::kCancelled, ScanOutcome::kFailed}) {
    const std::string id = store.scans.Begin({.patient_id = patient,
                                              .reference_id = {},
                                              .purpose = ScanPurpose::kFraction,
                                              .sensor_serial = "S1",
                                              .session_id = session});
    store.scans.Finish(id, {.outcome = outcome,
                            .failure = Message::Verbatim("discarded"),
                            .result_json = testing::ResultWith(R"({"verdict":"move"})"),
                            .swept_area_m2 = 1.0});
    EXPECT_FALSE(store.scans.Find(id)->result);
  }
  (void)store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.treatments.Opened()->fraction, 1);
}

TEST_F(StoreSessionsTest, AScanWithoutASessionIsOfNoPatient) {
  Store store(folder_ / "state");
  (void)store.patients.Add(kAnna, "P-1", "");
  const std::string scan = Scan(store, "", "");
  EXPECT_EQ(store.scans.Find(scan)->patient_id, "");
  EXPECT_EQ(store.scans.Find(scan)->fraction, 0);
  EXPECT_THAT(store.patients.List(), SizeIs(1)) << "the place of such scans is no patient";
  EXPECT_FALSE(store.patients.Find("0"));
  EXPECT_THAT(store.scans.List("", 10), SizeIs(1));
}

TEST_F(StoreSessionsTest, SiteAndNoteAreChangedAndTheirTextIsNotInTheLog) {
  std::string patient;
  {
    Store store(folder_ / "state");
    patient = store.patients.Add(kAnna, "P-1", "thorx");
    EXPECT_EQ(store.patients.Find(patient)->note, "");
    store.patients.Change(kBert, patient, {.site = "thorax", .note = "arms up, knee rest"});
    EXPECT_EQ(RefusalOf([&] { store.patients.Change(kBert, "77", {.site = "", .note = ""}); }),
              ChangeResult::kNotFound);
    EXPECT_EQ(RefusalOf([&] { store.patients.Change(kBert, "0", {.site = "", .note = ""}); }),
              ChangeResult::kNotFound)
        << "the one of unassigned scans";
  }
  Store store(folder_ / "state");
  EXPECT_EQ(store.patients.Find(patient)->site, "thorax");
  EXPECT_EQ(store.patients.Find(patient)->note, "arms up, knee rest");
  const AuditEntry entry = store.audit.Find({0, 1}).at(0);
  EXPECT_EQ(entry.action, "patient.change");
  EXPECT_EQ(entry.user, "bert");
  EXPECT_EQ((entry.subject + entry.detail.English()).find("knee"), std::string::npos);
  EXPECT_EQ(entry.detail.English(), "site and note");
  store.patients.Change(kBert, patient, {.site = "thorax", .note = ""});
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(), "note");
  store.patients.Change(kBert, patient, {.site = "pelvis", .note = ""});
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(), "site");
}

TEST_F(StoreSessionsTest, TheSetUpSheetIsKeptApartFromTheLogAndGoesWithThePatient) {
  const std::string jpeg = std::string("\xFF\xD8\xFF", 3) + std::string(3000, 'p');
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "thorax");
  EXPECT_FALSE(store.patients.Photo(patient));
  store.patients.Change(
      kBert, patient,
      {.site = "thorax", .note = "", .immobilisation = "wing board", .alert = "pacemaker"});
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "patient.set_up");
  store.patients.SetPhoto(kBert, patient, jpeg);
  EXPECT_TRUE(store.patients.Find(patient)->has_photo);
  EXPECT_EQ(store.patients.Photo(patient), jpeg);
  // A change of the note leaves it as it is.
  store.patients.Change(kBert, patient, {.site = "thorax", .note = "arms up"});
  EXPECT_EQ(store.patients.Find(patient)->alert, "pacemaker");
  EXPECT_EQ(store.patients.Find(patient)->immobilisation, "wing board");
  EXPECT_EQ(RefusalOf([&] {
              store.patients.Change(
                  kBert, patient, {.site = "thorax", .note = "arms up", .alert = "none"},
                  CourseNotes{.site = "thorax", .note = "arms up", .alert = "latex"});
            }),
            ChangeResult::kConflict)
      << "somebody else has written another alert";
  EXPECT_EQ(
      RefusalOf([&] { store.patients.SetPhoto(kBert, patient, std::string(kMaxPhoto + 1, 'p')); }),
      ChangeResult::kInvalid);
  for (const AuditEntry& entry : store.audit.Find({0, 100}))
    EXPECT_EQ(entry.detail.English().find("pacemaker"), std::string::npos) << entry.action;
  // What an import brought is shown only if it can be a picture.
  store.database().ForChanges()->Run("UPDATE patients SET photo = 'PHNjcmlwdD4='");
  EXPECT_FALSE(store.patients.Photo(patient));
  store.patients.SetPhoto(kBert, patient, jpeg);
  store.patients.SetPhoto(kBert, patient, "");
  EXPECT_FALSE(store.patients.Photo(patient));
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "patient.photo_remove");
}

TEST_F(StoreSessionsTest, ADrawingBelongsToThePictureThatItWasMadeOver) {
  const std::string jpeg = std::string("\xFF\xD8\xFF", 3);
  const std::vector<DrawnPoint> drawn = {{0.25, 0.5, true}, {0.3, 0.517, false}, {1.0, 0.0, true}};
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "thorax");
  const auto revision = [&] { return store.patients.Find(patient)->sheet_revision; };
  EXPECT_THAT(store.patients.Drawing(patient), IsEmpty());
  store.patients.SetPhoto(kAnna, patient, jpeg);
  const int seen = revision();
  store.patients.SetDrawing(kBert, patient, drawn, seen);
  EXPECT_EQ(store.patients.Drawing(patient), drawn);
  EXPECT_TRUE(store.patients.Find(patient)->has_drawing);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "patient.drawing");
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(), "");
  EXPECT_EQ(RefusalOf([&] { store.patients.SetDrawing(kAnna, patient, {}, seen); }),
            ChangeResult::kConflict)
      << "somebody else has drawn meanwhile";
  store.patients.SetPhoto(kAnna, patient, jpeg);
  EXPECT_THAT(store.patients.Drawing(patient), IsEmpty()) << "another picture";
  EXPECT_EQ(RefusalOf([&] { store.patients.SetDrawing(kBert, patient, drawn, seen + 1); }),
            ChangeResult::kConflict)
      << "drawn over the picture before";
  store.patients.SetDrawing(kBert, patient, drawn, revision());
  store.patients.SetDrawing(kBert, patient, {}, revision());
  EXPECT_FALSE(store.patients.Find(patient)->has_drawing);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "patient.drawing_remove");
  for (const char* other : {"<svg>", "1,2", "2000,1,1;", "-1,0,1;", "5,5,1;x"}) {
    store.database().ForChanges()->Run("UPDATE patients SET drawing = ?", std::string(other));
    EXPECT_THAT(store.patients.Drawing(patient), IsEmpty()) << other;
  }
}

TEST_F(StoreSessionsTest, AnArchivedPatientKeepsEverythingAndIsNotOpened) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kReference);
  const std::string scan = Scan(store, patient, session);
  (void)store.references.Add(kAnna, scan, "first", {});
  EXPECT_THAT(store.references.Waiting(), SizeIs(1));
  EXPECT_EQ(RefusalOf([&] { store.patients.Archive(kBert, patient, true); }),
            ChangeResult::kConflict)
      << "while the session is open";
  store.treatments.CloseAll(kAnna);
  store.patients.Archive(kBert, patient, true);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "patient.archive");
  EXPECT_TRUE(store.patients.Find(patient)->archived);
  EXPECT_THAT(store.patients.List(), SizeIs(1)) << "still there for who asks";
  EXPECT_THAT(store.scans.List(patient, 10), SizeIs(1));
  EXPECT_THAT(store.references.List(patient), SizeIs(1));
  EXPECT_THAT(store.references.Waiting(), SizeIs(0)) << "waits for nobody";
  EXPECT_EQ(
      RefusalOf([&] { (void)store.treatments.Open(kAnna, patient, ScanPurpose::kReference); }),
      ChangeResult::kConflict);
  store.patients.Archive(kBert, patient, false);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).action, "patient.unarchive");
  EXPECT_FALSE(store.patients.Find(patient)->archived);
  EXPECT_THAT(store.references.Waiting(), SizeIs(1));
  EXPECT_FALSE(store.treatments.Open(kAnna, patient, ScanPurpose::kReference).empty());
}

TEST_F(StoreSessionsTest, CodesDifferByMoreThanCase) {
  Store store(folder_ / "state");
  const std::string id = store.patients.Add(kAnna, "P-0042", "");
  EXPECT_EQ(RefusalOf([&] { (void)store.patients.Add(kAnna, "p-0042", ""); }),
            ChangeResult::kConflict);
  EXPECT_EQ(store.patients.FindByCode("p-0042")->id, id) << "a scanned wristband";
}

TEST_F(StoreSessionsTest, WhatIsSignedIsWhatIsStored) {
  Store store(folder_ / "state");
  const std::string patient = store.patients.Add(kAnna, "P-1", "");
  const std::string reference = store.references.Add(kAnna, Scan(store, patient, ""), "first", {});
  ASSERT_THAT(store.references.Waiting(), SizeIs(1));
  EXPECT_EQ(store.references.Waiting()[0].patient_code, "P-1");
  EXPECT_EQ(store.references.Waiting()[0].planned_by, "");
  EXPECT_EQ(store.patients.Find(patient)->draft_reference_id, reference);
  const std::string digest = store.references.Find(reference)->digest;
  EXPECT_EQ(digest.size(), 64U);
  ReferencePlan wider;
  wider.tolerance.shift_mm = 5;
  (void)store.references.Plan(kAnna, reference, 1, wider);
  EXPECT_EQ(store.references.Waiting()[0].planned_by, "anna");
  EXPECT_NE(store.references.Find(reference)->digest, digest);
  EXPECT_EQ(RefusalOf([&] { store.references.Approve(kBert, reference, 2, digest); }),
            ChangeResult::kConflict);
  const std::string signed_digest = store.references.Find(reference)->digest;
  store.references.Approve(kBert, reference, 2, signed_digest);
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(), "sha256 " + signed_digest);
  EXPECT_THAT(store.references.Waiting(), SizeIs(0));
  EXPECT_EQ(store.patients.Find(patient)->draft_reference_id, "");
  // The next version, whose posture was confirmed although the surface speaks against it.
  const std::string next = store.references.Plan(kAnna, reference, 2, {});
  const Reference draft = *store.references.Find(next);
  store.references.Approve(kBert, next, draft.revision, draft.digest, /*two_users=*/true, "",
                           {.posture = true});
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(),
            "sha256 " + draft.digest + "; posture confirmed against the surface");
  const std::string skin = store.references.Plan(kAnna, next, draft.revision, {});
  const Reference third = *store.references.Find(skin);
  store.references.Approve(kBert, skin, third.revision, third.digest, /*two_users=*/true, "",
                           {.skin_threshold_hu = -300});
  EXPECT_EQ(store.audit.Find({0, 1}).at(0).detail.English(),
            "sha256 " + third.digest + "; the skin of CT images at -300 HU confirmed");
}

}  // namespace
}  // namespace plumb
