// SPDX-License-Identifier: Apache-2.0
// Received planning files and the worklist of today, as the page asks for them.
#include <gmock/gmock.h>

#include "tests/unit/web/web_fixture.hpp"
#include "words/dicom.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

class ReceivedTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
    physicist_ = LoggedIn("physicist");
    patient_ = physicist_.Post("/api/v1/patients", {{"code", "CT-1"}, {"site", ""}})
                   .json()
                   .value("id", "");
    service_.received = {.is_on = true,
                         .files = {{.name = "p",
                                    .kind = ReceivedKind::kPlan,
                                    .received_at = "2026-03-01T09:30:00Z",
                                    .sender = "TPS",
                                    .address = "10.1.2.3",
                                    .bytes = 5000,
                                    .label = "breast",
                                    .structures = "s"},
                                   {.name = "s",
                                    .kind = ReceivedKind::kStructures,
                                    .fault = say::dicom::CannotRead()}},
                         .images = 98};
  }
  int Import(const nlohmann::json& body) {
    return physicist_.Post("/api/v1/patients/" + patient_ + "/planning/received", body).status;
  }
  HttpClient physicist_{0};
  std::string patient_;
};

TEST_F(ReceivedTest, TheListSaysFromWhomWhenAndWhatBecameOfIt) {
  nlohmann::json found = physicist_.Get("/api/v1/planning/received").json();
  EXPECT_EQ(found["images"], 98);
  EXPECT_EQ(found["is_settled"], true);
  EXPECT_EQ(found["files"][0]["sender"], "TPS");
  EXPECT_EQ(found["files"][0]["received_at"], "2026-03-01T09:30:00Z");
  EXPECT_EQ(found["files"][0]["structures"], "s");
  EXPECT_EQ(found["files"][1]["fault_message"]["id"], "dicom.cannot_read");
  EXPECT_EQ(Import({{"structures", "s"}, {"plan", "p"}, {"roi", "BODY"}, {"reason", "new plan"}}),
            201);
  EXPECT_EQ(service_.sent_planning.roi, "BODY");
  EXPECT_EQ(service_.sent_planning.reason, "new plan");
  found = physicist_.Get("/api/v1/planning/received").json();
  EXPECT_EQ(found["files"][0]["reference_id"], service_.references.back().id);
}

TEST_F(ReceivedTest, WhatIsNotThereAndOtherFieldsAreRefused) {
  EXPECT_EQ(Import({{"structures", "s"}, {"plan", "x"}}), 404);
  EXPECT_EQ(Import({{"structures", "s"}}), 400);
  EXPECT_EQ(Import({{"structures", std::string(65, 'a')}, {"plan", "p"}}), 400);
  EXPECT_EQ(Import({{"structures", "s"}, {"plan", "p"}, {"file", "/etc/passwd"}}), 400);
  EXPECT_EQ(Import({{"structures", "s"}, {"plan", "p"}, {"same_patient", "yes"}}), 400)
      << "it is a truth value";
  EXPECT_TRUE(service_.references.empty());
}

TEST_F(ReceivedTest, TheWorklistNamesThoseWhoAreKnownAndCountsTheOthers) {
  service_.worklist = {.is_on = true,
                       .patients = {{.time = "09:30", .patient_id = "1", .patient_code = "CT-1"}},
                       .unknown = 3};
  HttpClient technician = LoggedIn("technician");
  const nlohmann::json list = technician.Get("/api/v1/worklist").json();
  EXPECT_EQ(list["patients"][0]["patient_code"], "CT-1");
  EXPECT_EQ(list["unknown"], 3);
  EXPECT_TRUE(list["fault"].is_null());
  EXPECT_THAT(LoggedIn("engineer").Get("/api/v1/audit").body, HasSubstr("view.patients"));
}

}  // namespace
}  // namespace plumb::test
