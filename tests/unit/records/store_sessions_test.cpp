// Treatment sessions, waiting references and paired screens in the store.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::SizeIs;
using web::ChangeResult;
using web::ScanPurpose;

const web::Actor kAnna{.user = "anna", .address = "::1"};
const web::Actor kBert{.user = "bert", .address = "::1"};

class StoreSessionsTest : public ::testing::Test {
 protected:
  static std::string Scan(Store& store, const std::string& patient, const std::string& session,
                          const std::string& result = "") {
    const std::string id = store.BeginScan({.patient_id = patient,
                                            .reference_id = {},
                                            .purpose = ScanPurpose::kFraction,
                                            .sensor_serial = "S1",
                                            .reason = {},
                                            .session_id = session,
                                            .sensor_on_s = 90.0,
                                            .check_overdue = true});
    fs::create_directories(store.StagingFolder(id) / "scene");
    WriteWholeFile(store.StagingFolder(id) / "scene" / "scene.json", std::string_view("{}"));
    store.FinishScan(id, {.outcome = web::ScanOutcome::kDone,
                          .failure = {},
                          .result_json = result,
                          .swept_area_m2 = 1.0});
    return id;
  }
  template <typename Call>
  static ChangeResult RefusalOf(const Call& call) {
    try {
      call();
    } catch (const StoreRefusal& refusal) {
      return refusal.result();
    }
    return ChangeResult::kDone;
  }

  testing::TempFolder folder_;
};

TEST_F(StoreSessionsTest, OneIsOpenAtATime) {
  Store store(folder_ / "state");
  const std::string a = store.AddPatient(kAnna, "P-1", ""), b = store.AddPatient(kAnna, "P-2", "");
  EXPECT_FALSE(store.OpenedSession());
  const std::string first = store.OpenSession(kAnna, a, ScanPurpose::kFraction);
  ASSERT_TRUE(store.OpenedSession());
  EXPECT_EQ(store.OpenedSession()->patient_code, "P-1");
  EXPECT_EQ(store.OpenedSession()->opened_by, "anna");
  const std::string second = store.OpenSession(kBert, b, ScanPurpose::kReference);
  EXPECT_NE(first, second);
  EXPECT_EQ(store.OpenedSession()->id, second);
  EXPECT_EQ(store.OpenedSession()->fraction, 0);
  store.CloseSessions(kBert);
  EXPECT_FALSE(store.OpenedSession());
  EXPECT_EQ(RefusalOf([&] { (void)store.OpenSession(kAnna, "99", ScanPurpose::kFraction); }),
            ChangeResult::kNotFound);
}

TEST_F(StoreSessionsTest, FractionNumbersCountSessionsNotScans) {
  Store store(folder_ / "state");
  const std::string patient = store.AddPatient(kAnna, "P-1", "");
  const std::string first = store.OpenSession(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.OpenedSession()->fraction, 1);
  const std::string moved = Scan(store, patient, first, R"({"verdict":"move"})");
  const std::string right = Scan(store, patient, first, R"({"verdict":"in_tolerance"})");
  EXPECT_EQ(store.OpenedSession()->num_scans, 2);
  EXPECT_EQ(store.FindScan(moved)->fraction, 1);
  EXPECT_EQ(store.FindScan(right)->fraction, 1);
  EXPECT_EQ(store.FindScan(right)->session_id, first);
  EXPECT_EQ(store.FindScan(right)->sensor_on_s, 90.0);
  EXPECT_TRUE(store.FindScan(right)->check_overdue);
  (void)store.OpenSession(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.OpenedSession()->fraction, 2);
  (void)store.OpenSession(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(store.OpenedSession()->fraction, 2) << "nothing was scanned in the session before";
}

TEST_F(StoreSessionsTest, AScanWithoutASessionIsOfNoPatient) {
  Store store(folder_ / "state");
  (void)store.AddPatient(kAnna, "P-1", "");
  const std::string scan = Scan(store, "", "");
  EXPECT_EQ(store.FindScan(scan)->patient_id, "");
  EXPECT_EQ(store.FindScan(scan)->fraction, 0);
  EXPECT_THAT(store.Patients(), SizeIs(1)) << "the place of such scans is no patient";
  EXPECT_FALSE(store.FindPatient("0"));
  EXPECT_THAT(store.Scans("", 10), SizeIs(1));
}

TEST_F(StoreSessionsTest, SiteAndNoteAreChangedAndTheirTextIsNotInTheLog) {
  std::string patient;
  {
    Store store(folder_ / "state");
    patient = store.AddPatient(kAnna, "P-1", "thorx");
    EXPECT_EQ(store.FindPatient(patient)->note, "");
    store.ChangePatient(kBert, patient, "thorax", "arms up, knee rest");
    EXPECT_EQ(RefusalOf([&] { store.ChangePatient(kBert, "77", "", ""); }),
              ChangeResult::kNotFound);
    EXPECT_EQ(RefusalOf([&] { store.ChangePatient(kBert, "0", "", ""); }), ChangeResult::kNotFound)
        << "the one of unassigned scans";
  }
  Store store(folder_ / "state");
  EXPECT_EQ(store.FindPatient(patient)->site, "thorax");
  EXPECT_EQ(store.FindPatient(patient)->note, "arms up, knee rest");
  const web::AuditEntry entry = store.Audit({0, 1}).at(0);
  EXPECT_EQ(entry.action, "patient.change");
  EXPECT_EQ(entry.user, "bert");
  EXPECT_EQ((entry.subject + entry.detail).find("knee"), std::string::npos);
}

TEST_F(StoreSessionsTest, AnArchivedPatientKeepsEverythingAndIsNotOpened) {
  Store store(folder_ / "state");
  const std::string patient = store.AddPatient(kAnna, "P-1", "");
  const std::string session = store.OpenSession(kAnna, patient, ScanPurpose::kReference);
  const std::string scan = Scan(store, patient, session);
  (void)store.AddReference(kAnna, scan, "first", {});
  EXPECT_THAT(store.WaitingReferences(), SizeIs(1));
  EXPECT_EQ(RefusalOf([&] { store.ArchivePatient(kBert, patient, true); }), ChangeResult::kConflict)
      << "while the session is open";
  store.CloseSessions(kAnna);
  store.ArchivePatient(kBert, patient, true);
  EXPECT_EQ(store.Audit({0, 1}).at(0).action, "patient.archive");
  EXPECT_TRUE(store.FindPatient(patient)->archived);
  EXPECT_THAT(store.Patients(), SizeIs(1)) << "still there for who asks";
  EXPECT_THAT(store.Scans(patient, 10), SizeIs(1));
  EXPECT_THAT(store.References(patient), SizeIs(1));
  EXPECT_THAT(store.WaitingReferences(), SizeIs(0)) << "waits for nobody";
  EXPECT_EQ(RefusalOf([&] { (void)store.OpenSession(kAnna, patient, ScanPurpose::kReference); }),
            ChangeResult::kConflict);
  store.ArchivePatient(kBert, patient, false);
  EXPECT_EQ(store.Audit({0, 1}).at(0).action, "patient.unarchive");
  EXPECT_FALSE(store.FindPatient(patient)->archived);
  EXPECT_THAT(store.WaitingReferences(), SizeIs(1));
  EXPECT_FALSE(store.OpenSession(kAnna, patient, ScanPurpose::kReference).empty());
}

TEST_F(StoreSessionsTest, CodesDifferByMoreThanCase) {
  Store store(folder_ / "state");
  const std::string id = store.AddPatient(kAnna, "P-0042", "");
  EXPECT_EQ(RefusalOf([&] { (void)store.AddPatient(kAnna, "p-0042", ""); }),
            ChangeResult::kConflict);
  EXPECT_EQ(store.FindPatientByCode("p-0042")->id, id) << "a scanned wristband";
}

TEST_F(StoreSessionsTest, WhatIsSignedIsWhatIsStored) {
  Store store(folder_ / "state");
  const std::string patient = store.AddPatient(kAnna, "P-1", "");
  const std::string reference = store.AddReference(kAnna, Scan(store, patient, ""), "first", {});
  ASSERT_THAT(store.WaitingReferences(), SizeIs(1));
  EXPECT_EQ(store.WaitingReferences()[0].patient_code, "P-1");
  EXPECT_EQ(store.FindPatient(patient)->draft_reference_id, reference);
  const std::string digest = store.FindReference(reference)->digest;
  EXPECT_EQ(digest.size(), 64U);
  web::ReferencePlan wider;
  wider.tolerance.shift_mm = 5;
  (void)store.PlanReference(kAnna, reference, 1, wider);
  EXPECT_NE(store.FindReference(reference)->digest, digest);
  EXPECT_EQ(RefusalOf([&] { store.ApproveReference(kBert, reference, 2, digest); }),
            ChangeResult::kConflict);
  const std::string signed_digest = store.FindReference(reference)->digest;
  store.ApproveReference(kBert, reference, 2, signed_digest);
  EXPECT_EQ(store.Audit({0, 1}).at(0).detail, "sha256 " + signed_digest);
  EXPECT_THAT(store.WaitingReferences(), SizeIs(0));
  EXPECT_EQ(store.FindPatient(patient)->draft_reference_id, "");
}

TEST_F(StoreSessionsTest, PairedScreensStayOverARestart) {
  {
    Store store(folder_ / "state");
    (void)store.AddDisplay(
        kAnna,
        {.id = {}, .name = "couch side", .token_hash = "ab", .paired_at = {}, .paired_by = {}});
  }
  Store store(folder_ / "state");
  ASSERT_THAT(store.Displays(), SizeIs(1));
  EXPECT_EQ(store.Displays()[0].paired_by, "anna");
  store.RemoveDisplay(kBert, store.Displays()[0].id);
  EXPECT_THAT(store.Displays(), SizeIs(0));
  EXPECT_EQ(RefusalOf([&] { store.RemoveDisplay(kBert, "1"); }), ChangeResult::kNotFound);
}

}  // namespace
}  // namespace plumb
