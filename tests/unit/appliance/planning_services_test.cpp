// SPDX-License-Identifier: Apache-2.0
// Imports of planning CTs by the page's services, and what happens on the loop meanwhile.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/appliance/appliance_fixture.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb::testing {
namespace {

class PlanningServicesTest : public ApplianceTest {
 protected:
  PlanningServicesTest() {
    parts_.demo_patient.clear();
    Send("SIM-1");
  }

  /// @param more  Behind both files.
  void Send(const std::string& patient_id, const std::string& more = {}) {
    auto [structures, plan] = SmallCt();
    structures.file.patient_id = plan.file.patient_id = patient_id;
    const std::string first = DicomBytes(structures), second = DicomBytes(plan);
    sent_.file = Written(folder_ / "both.dcm", first + second + more);
    sent_.structures_bytes = first.size();
    sent_.plan_bytes = second.size();
  }

  /// Begins an import on the loop's thread, and does `meanwhile` there before it can end.
  Change Imported(const std::string& patient, const std::function<void()>& meanwhile = {}) {
    std::promise<Change> imported;
    On([&] {
      services_->services().references.AddPlanning(
          kTester, patient, sent_, [&](const Change& change) { imported.set_value(change); });
      if (meanwhile) meanwhile();
    });
    return imported.get_future().get();
  }

  web::SentPlanning sent_;
};

TEST_F(PlanningServicesTest, ASessionThatIsOpenedDuringAnImportKeepsItsResult) {
  Play([&] {
    LetOpen();
    std::string patient, other;
    On([&] {
      patient = shared_->store->patients.Add(kTester, "P-1", "");
      other = shared_->store->patients.Add(kTester, "P-2", "");
    });
    const auto open = [&](const std::string& whose) {
      return
          [this, whose] { shared_->session.Open("1", whose, ScanPurpose::kFraction, "", kTester); };
    };
    const Change refused = Imported(patient, open(patient));
    EXPECT_EQ(refused.result, ChangeResult::kConflict);
    EXPECT_EQ(refused.message.id(), "store.session_open") << refused.message.English();
    On([&] {
      EXPECT_TRUE(shared_->store->references.List(patient).empty());
      EXPECT_FALSE(shared_->store->scans.Find("1")) << "it would be newer than the session's";
    });
    EXPECT_EQ(Imported(patient).message.id(), "store.session_open") << "nor one that begins then";
    On([&] { shared_->session.Forget(); });
    const Change imported = Imported(patient, open(other));
    EXPECT_EQ(imported.result, ChangeResult::kDone) << imported.message.English();
    On([&] { shared_->session.Forget(); });
  });
}

TEST_F(PlanningServicesTest, FilesOfAnotherPatientAreDoubtedBeforeTheirImagesAreRead) {
  Play([&] {
    LetOpen();
    std::string patient;
    On([&] { patient = shared_->store->patients.Add(kTester, "P-1", ""); });
    EXPECT_EQ(Imported(patient).result, ChangeResult::kDone);
    Send("OTHER-1", "no image");
    sent_.threshold_hu = -300;
    EXPECT_EQ(Imported(patient).message.id(), "store.planning_patient_differs");
    sent_.is_same_patient = true;
    EXPECT_EQ(Imported(patient).message.id(), "store.planning_needs_reason");
    sent_.reason = "renumbered";
    EXPECT_EQ(Imported(patient).message.id(), "scan.planning_images_cut") << "now they are read";
  });
}

TEST_F(PlanningServicesTest, ASecondImportOfReceivedFilesIsToldThatOneRuns) {
  Play([&] {
    LetOpen();
    std::promise<Change> first, third;
    Change second;
    web::ReceivedChoice choice;
    choice.structures = "a";
    choice.plan = "b";
    const auto import = [&](Done done) {
      services_->services().planning.ImportReceived(kTester, "1", choice, std::move(done));
    };
    const Done to_first = [&](const Change& change) { first.set_value(change); };
    const Done to_second = [&](const Change& change) { second = change; };
    const Done to_third = [&](const Change& change) { third.set_value(change); };
    On([&] {
      import(to_first);
      import(to_second);
    });
    EXPECT_EQ(second.result, ChangeResult::kConflict);
    EXPECT_EQ(second.message.id(), "scan.import_runs") << second.message.English();
    EXPECT_EQ(first.get_future().get().result, ChangeResult::kNotFound) << "no such files";
    On([&] { import(to_third); });
    EXPECT_EQ(third.get_future().get().result, ChangeResult::kNotFound) << "none runs any more";
  });
}

}  // namespace
}  // namespace plumb::testing
