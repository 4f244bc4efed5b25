// SPDX-License-Identifier: Apache-2.0
// A store in a folder of its own, and the calls that most tests of the store begin with.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb::testing {

/// The result of a comparison as plumbd stores it.
inline const std::string kResult = ResultWith(
    R"({"verdict":"move","reasons":["vertical is off"],"correction":{"vertical_mm":6.5,"longitudinal_mm":null,)"
    R"("lateral_mm":-1,"pitch_deg":0.5,"roll_deg":0,"yaw_deg":2,)"
    R"("uncertainty":{"vertical_mm":1.2,"pitch_deg":0.2,"roll_deg":0.3,"yaw_deg":0.1}}})");

class StoreTest : public ::testing::Test {
 protected:
  std::unique_ptr<Store> Open() const { return std::make_unique<Store>(folder_ / "state"); }

  static void FillStaging(const Store& store, const std::string& id) {
    std::filesystem::create_directories(store.folders.Staging(id) / "scene");
    WriteWholeFile(store.folders.Staging(id) / "scene" / "scene.json", std::string_view("{}"));
  }
  static std::string Scan(Store& store, const std::string& patient,
                          const std::string& reference = "", const std::string& result = "") {
    const std::string id = store.scans.Begin(
        {.patient_id = patient, .reference_id = reference, .purpose = {}, .sensor_serial = "S1"});
    FillStaging(store, id);
    store.scans.Finish(
        id, {.outcome = ScanOutcome::kDone, .result_json = result, .swept_area_m2 = 2.5});
    return id;
  }
  static std::string ApprovedReference(Store& store, const std::string& patient) {
    return testing::PlanAndApprove(store,
                                   store.references.Add(kAnna, Scan(store, patient), "first", {}));
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
  [[nodiscard]] std::filesystem::path database() const { return folder_ / "state" / "plumb.db"; }
  /// With what says that there was one.
  void RemoveDatabase() const {
    for (const char* name : {"plumb.db", "plumb.db-mark", "plumb.db-seals", "last-scan"})
      std::filesystem::remove(folder_ / "state" / name);
  }

  TempFolder folder_;
};

}  // namespace plumb::testing
