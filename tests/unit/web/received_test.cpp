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
                                    .structures = "s",
                                    .series = {"2.25.7"}},
                                   {.name = "s",
                                    .kind = ReceivedKind::kStructures,
                                    .fault = say::dicom::CannotRead()}},
                         .series = {{.uid = "2.25.7", .sender = "TPS", .images = 90}},
                         .images = 98,
                         .unread = 3,
                         .damaged_images = 5,
                         .image_fault = say::dicom::CannotRead()};
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
  EXPECT_EQ(found["files"][0]["series"], nlohmann::json::array({"2.25.7"}));
  EXPECT_EQ(found["files"][0]["has_skin"], false);
  EXPECT_EQ(found["series"][0]["uid"], "2.25.7");
  EXPECT_EQ(found["series"][0]["images"], 90);
  EXPECT_EQ(found["unread"], 3);
  EXPECT_EQ(found["damaged_images"], 5);
  EXPECT_EQ(found["image_fault_message"]["id"], "dicom.cannot_read");
  EXPECT_EQ(found["files"][1]["fault_message"]["id"], "dicom.cannot_read");
  EXPECT_EQ(Import({{"structures", "s"}, {"plan", "p"}, {"roi", "BODY"}, {"reason", "new plan"}}),
            201);
  EXPECT_EQ(service_.sent_planning.roi, "BODY");
  EXPECT_EQ(service_.sent_planning.reason, "new plan");
  found = physicist_.Get("/api/v1/planning/received").json();
  EXPECT_EQ(found["files"][0]["reference_id"], service_.references.back().id);
}

TEST_F(ReceivedTest, ImagesNeedTheThresholdOfTheirSkin) {
  const nlohmann::json images = {{"plan", "p"}, {"series", "2.25.7"}};
  const auto at = [&](const nlohmann::json& threshold) {
    nlohmann::json body = images;
    body["threshold_hu"] = threshold;
    return Import(body);
  };
  EXPECT_EQ(Import(images), 400);
  for (const double wrong : {-900.5, 0.5}) EXPECT_EQ(at(wrong), 400) << wrong;
  EXPECT_EQ(at("soft"), 400);
  EXPECT_TRUE(service_.references.empty());
  for (const double right : {-900.0, 0.0}) {
    EXPECT_EQ(at(right), 201) << right;
    EXPECT_EQ(service_.sent_planning.threshold_hu, right);
  }
  EXPECT_EQ(Import({{"structures", "s"}, {"plan", "p"}, {"threshold_hu", -300}}), 400)
      << "of which images?";
  EXPECT_EQ(Import({{"plan", "p"}}), 400) << "neither a contour nor images";
  EXPECT_EQ(Import({{"plan", "p"}, {"series", "2.25.8"}, {"threshold_hu", -300}}), 404);
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
