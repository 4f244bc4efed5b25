// SPDX-License-Identifier: Apache-2.0
// What the log's entries are about, as people know it.
#include <gmock/gmock.h>

#include "tests/unit/records/store_fixture.hpp"

namespace plumb::testing {
namespace {

using ::testing::ElementsAre;

/// The newest entry of an action, in one line: kind, code, number.
std::string About(Store& store, const std::string& action) {
  const auto entry = store.audit.Find({0, 1, action}).at(0);
  if (!entry.about) return "its own name: " + entry.subject;
  return entry.about->kind + (entry.about->exists ? " " : " gone ") + entry.about->patient_code +
         " " + std::to_string(entry.about->number);
}

TEST_F(StoreTest, TheLogNamesWhatPeopleKnow) {
  const auto store = Open();
  const std::string other = store->patients.Add(kAnna, "P-1", "");
  const std::string patient = store->patients.Add(kAnna, "P-2", "");
  EXPECT_EQ(About(*store, "patient.add"), "patient P-2 0");
  const std::string reference = ApprovedReference(*store, patient);
  EXPECT_EQ(About(*store, "reference.approve"), "reference P-2 1");
  const std::string session = store->treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  EXPECT_EQ(About(*store, "session.open"), "session P-2 1");
  for (const char* action : {"scan.start", "scan.end", "cancel"}) {
    store->audit.Log(kBert, action, session, "fraction");
    EXPECT_EQ(About(*store, action), "session P-2 1") << "it had no number yet";
    store->audit.Log(kBert, action, "", "");
    EXPECT_EQ(About(*store, action), "its own name: ") << "of an earlier version";
  }
  const std::string scan = Scan(*store, patient, reference, kResult);
  store->audit.Log(kBert, "view.scan", scan, "");
  EXPECT_EQ(About(*store, "view.scan"), "scan P-2 0");
  store->audit.Log(kBert, "download.course", patient, "course.zip");
  EXPECT_EQ(About(*store, "download.course"), "patient P-2 0");
  store->audit.Log(kBert, "download.report", scan, "report.pdf");
  EXPECT_EQ(About(*store, "download.report"), "scan P-2 0");
  store->audit.Log(kBert, "view.patients", "", "");
  EXPECT_EQ(About(*store, "view.patients"), "its own name: ");
  store->audit.Log(kBert, "user.add", "7", "technician");
  EXPECT_EQ(About(*store, "user.add"), "its own name: 7") << "an account of that name";

  const std::string unassigned = Scan(*store, "");
  store->audit.Log(kBert, "view.scan", unassigned, "");
  EXPECT_EQ(About(*store, "view.scan"), "scan  0") << "of no patient";
  store->removal.RemoveScan(kBert, unassigned, "by mistake");
  EXPECT_EQ(About(*store, "scan.remove"), "scan gone  0");

  Display screen;
  screen.name = "couch side";
  screen.token_hash = "a";
  const std::string display = store->displays.Add(kAnna, screen);
  EXPECT_EQ(About(*store, "display.pair"), "its own name: couch side");
  store->displays.Remove(kAnna, display);
  EXPECT_EQ(About(*store, "display.remove"), "its own name: couch side");
  EXPECT_EQ(RefusalOf([&] { store->displays.Remove(kAnna, display); }), ChangeResult::kNotFound);
}

TEST_F(StoreTest, TheLogKeepsNoCodeOfAPatientWhoseDataWasDeleted) {
  const auto store = Open();
  const std::string patient = store->patients.Add(kAnna, "P-2", "");
  store->treatments.Open(kAnna, patient, ScanPurpose::kReference);
  store->treatments.CloseAll(kAnna);
  store->removal.WipePatient(kBert, patient);
  for (const char* action : {"patient.add", "patient.wipe"})
    EXPECT_EQ(About(*store, action), "patient gone  0");
  EXPECT_EQ(About(*store, "session.open"), "session gone  0");
}

}  // namespace
}  // namespace plumb::testing
