// SPDX-License-Identifier: Apache-2.0
// What comes by DICOM, on the page of a real plumbd: received files, and the worklist of DCMTK's
// own server.
#include <algorithm>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/integration/dicomd.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/skip.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb {
namespace {

using nlohmann::json;
using test::HttpClient;
using test::kPassword;
using testing::Plumbd;
namespace fs = std::filesystem;

constexpr const char* kId = "KH-4711-SECRET";

std::string LocalDay(int days_from_now) {
  const std::time_t time = std::time(nullptr) + 24L * 3600 * days_from_now;
  std::tm local{};
  ::localtime_r(&time, &local);
  return fmt::format("{:04}{:02}{:02}", local.tm_year + 1900, local.tm_mon + 1, local.tm_mday);
}

class DaemonDicomTest : public ::testing::Test {
 protected:
  void SetUp() override {
    worklist_port_ = testing::FreePort();
    dicomd_ = std::make_unique<testing::Dicomd>(
        folder_.path(), fmt::format("worklist = \"CLINIC@127.0.0.1:{}\"\n", worklist_port_));
    plumbd_ = std::make_unique<Plumbd>(
        folder_.path(),
        testing::PlumbdOptions{.arguments = {"--config", dicomd_->config().string()}});
    for (int i = 0; i < 10 && !plumbd_->WaitUntilUp(); ++i) {
    }
    plumbd_->WaitForState("ready");
    HttpClient engineer = plumbd_->MakeFirstAccount();
    ASSERT_TRUE(test::AddAccount(plumbd_->port(), engineer, "planner", "physicist"));
    planner_ = std::make_unique<HttpClient>(plumbd_->port());
    ASSERT_EQ(planner_->LogIn("planner", kPassword), 200);
    patient_ = planner_->Post("/api/v1/patients", {{"code", "CT-1"}, {"site", "thorax"}})
                   .json()
                   .value("id", "");
  }

  void SendSmallCt() {
    auto [structures, plan] = SmallCt();
    structures.file.patient_id = plan.file.patient_id = kId;
    dicomd_->Send({DicomBytes(structures), DicomBytes(plan)});
  }

  /// What a page shows once the appliance has looked, and `enough` holds.
  json Settled(const char* path, const std::function<bool(const json&)>& enough) {
    return testing::Settled(*planner_, path, enough);
  }
  json ReceivedOf(const std::string& kind, const std::function<bool(const json&)>& enough) {
    json one;
    (void)Settled("/api/v1/planning/received", [&](const json& found) {
      for (const json& file : found["files"])
        if (file["kind"] == kind && file["is_read"] == true && enough(file)) one = file;
      return !one.is_null();
    });
    return one;
  }

  testing::TempFolder folder_;
  int worklist_port_ = 0;
  std::unique_ptr<testing::Dicomd> dicomd_;
  std::unique_ptr<Plumbd> plumbd_;
  std::unique_ptr<HttpClient> planner_;
  std::string patient_;
};

TEST_F(DaemonDicomTest, WhatWasReceivedIsListedAndImportedByAPersonOnly) {
  EXPECT_TRUE(
      Settled("/api/v1/planning/received", [](const json&) { return true; })["files"].empty());
  SendSmallCt();
  const json plan = ReceivedOf("plan", [](const json& file) { return file["structures"] != ""; });
  const json structures = ReceivedOf("structures", [](const json&) { return true; });
  EXPECT_EQ(plan["structures"], structures["name"]);
  EXPECT_EQ(plan["sender"], "TPS");
  EXPECT_EQ(plan["address"], "127.0.0.1");
  EXPECT_EQ(plan["patient_code"], "") << "nobody's planning files state this Patient ID yet";
  EXPECT_EQ(plan["reference_id"], "");
  const std::string references = "/api/v1/patients/" + patient_ + "/references";
  EXPECT_TRUE(planner_->Get(references).json()["references"].empty()) << "nothing by itself";

  const auto import = [&](const json& body) {
    return planner_->Post("/api/v1/patients/" + patient_ + "/planning/received", body);
  };
  EXPECT_EQ(import({{"structures", "20260101-000000-0"}, {"plan", plan["name"]}}).status, 404);
  EXPECT_EQ(import({{"structures", "../../etc/passwd"}, {"plan", plan["name"]}}).status, 404);
  EXPECT_EQ(import({{"structures", plan["name"]}, {"plan", structures["name"]}}).status, 400)
      << "the wrong way round";
  const auto imported = import({{"structures", structures["name"]}, {"plan", plan["name"]}});
  ASSERT_EQ(imported.status, 201) << imported.body;
  const std::string reference = imported.json()["id"];
  EXPECT_EQ(planner_->Get(references).json()["references"].at(0)["id"], reference);
  const json after =
      ReceivedOf("plan", [](const json& file) { return file["reference_id"] != ""; });
  EXPECT_EQ(after["reference_id"], reference);
  EXPECT_EQ(after["patient_code"], "CT-1") << "by the keyed hash";

  // Another patient's files are asked about, as at an upload.
  const std::string other =
      planner_->Post("/api/v1/patients", {{"code", "CT-2"}, {"site", "x"}}).json().value("id", "");
  const auto mixed = planner_->Post("/api/v1/patients/" + other + "/planning/received",
                                    {{"structures", structures["name"]}, {"plan", plan["name"]}});
  EXPECT_EQ(mixed.status, 409) << mixed.body;
  EXPECT_EQ(mixed.json()["error_message"]["id"], "store.planning_patient_of");

  // Neither the state folder nor the journal names the patient. plumbd is stopped first: while it
  // runs, files come and go.
  EXPECT_EQ(plumbd_->Stop(), 0);
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "state")) {
    if (!entry.is_regular_file()) continue;
    EXPECT_NE(entry.path().extension(), ".dcm") << entry.path();
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(in)), {});
    EXPECT_EQ(bytes.find(kId), std::string::npos) << entry.path();
  }
  EXPECT_EQ(plumbd_->log().find(kId), std::string::npos);
}

/// Uploads of the images of the small CT, whose plan has no contour to offer.
class DaemonImagesTest : public DaemonDicomTest {
 protected:
  /// Of pixels of 1 mm: a surface is left beside the straight sides of the box.
  static std::vector<CtImage> FineImages() {
    std::vector<CtImage> images;
    simulated::MakeCtImages(SmallCt().first, {}, {.pixel_mm = 1.0},
                            [&](const CtImage& image) { images.push_back(image); });
    return images;
  }
  struct Sent {
    TreatmentPlan plan = SmallCt().second;
    std::vector<CtImage> images = FineImages();
    std::string threshold = "-300";
  };
  /// As the page sends it: the plan, and each image behind its size.
  test::HttpAnswer Upload(const Sent& sent, std::size_t cut_bytes = 0) {
    const std::string plan = DicomBytes(sent.plan);
    std::string body = plan;
    for (const CtImage& image : sent.images) {
      const std::string bytes = DicomBytes(image);
      for (std::size_t i = 0; i < 8; ++i)
        body += static_cast<char>(std::uint64_t{bytes.size()} >> (8 * i) & 0xFFU);
      body += bytes;
    }
    body.resize(body.size() - cut_bytes);
    HttpClient sender = *planner_;
    sender.extra_headers["Content-Type"] = "application/octet-stream";
    sender.extra_headers["X-Plumb-Planning"] = fmt::format(
        "structures_bytes=0&plan_bytes={}&threshold_hu={}", plan.size(), sent.threshold);
    return sender.Ask("POST", "/api/v1/patients/" + patient_ + "/planning", body);
  }
  /// Id of the message with which it is refused.
  std::string Refusal(const Sent& sent) {
    const auto answer = Upload(sent);
    EXPECT_EQ(answer.status, 400) << answer.body;
    EXPECT_EQ(answer.body.find(folder_.path().string()), std::string::npos) << "a path of ours";
    return answer.json()["error_message"].value("id", "");
  }
  void Change(Sent& sent, const std::function<void(CtImage&)>& change) {
    std::ranges::for_each(sent.images, change);
  }
};

TEST_F(DaemonImagesTest, ImagesThatDoNotFitThePlanAreRefusedWithTheCause) {
  ASSERT_EQ(Upload({}).status, 201) << Upload({}).body;
  Sent sent;
  Change(sent, [](CtImage& image) { image.file.patient_id = "SOMEBODY"; });
  EXPECT_EQ(Refusal(sent), "planning.images_other_patient");
  sent = {};
  Change(sent, [](CtImage& image) { image.file.frame_of_reference_uid = "2.25.99"; });
  EXPECT_EQ(Refusal(sent), "planning.other_frame");
  sent = {};
  Change(sent, [](CtImage& image) { image.position = "HFDR"; });
  EXPECT_EQ(Refusal(sent), "planning.images_position");
  sent = {.plan = SmallCt({.quirks = {simulated::CtQuirk::kDecubitus}}).second};
  EXPECT_EQ(Refusal(sent), "planning.position_refused");
  sent = {};
  sent.images.erase(sent.images.begin() + 4);
  EXPECT_EQ(Refusal(sent), "planning.images_missing");
  sent = {};
  sent.images.push_back(sent.images.front());
  EXPECT_EQ(Refusal(sent), "planning.image_twice");
  sent = {};
  sent.images.front().series_uid = "2.25.99";
  EXPECT_EQ(Refusal(sent), "planning.images_mixed");
  EXPECT_EQ(Refusal({.images = {}}), "scan.planning_no_images");
  EXPECT_EQ(Upload({}, 1).json()["error_message"]["id"], "scan.planning_images_cut");
  // The threshold must be stated, and be one of a skin.
  for (const char* right : {"-900", "-500"}) {
    const auto answer = Upload({.threshold = right});
    EXPECT_EQ(answer.status, 201) << right << answer.body;
  }
  for (const char* wrong : {"-900.1", "0.1", "nan", "soft"})
    EXPECT_EQ(Upload({.threshold = wrong}).status, 400) << wrong;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "state"))
    EXPECT_NE(entry.path().extension(), ".dcm") << "the files name the patient";
}

/// Servers of worklists, whose entries are files.
class DaemonWorklistTest : public DaemonDicomTest {
 protected:
  static bool IsInstalled() {
    return fs::exists("/usr/bin/wlmscpfs") && fs::exists("/usr/bin/dump2dcm");
  }
  void AddStep(const std::string& name, const std::string& id, const std::string& day,
               const std::string& time) {
    fs::create_directories(folder_ / "worklists/CLINIC");
    std::ofstream(folder_ / "worklists/CLINIC/lockfile");
    const fs::path text = folder_ / "step.txt";
    std::ofstream(text) << fmt::format(
        "(0008,0050) SH [{0}]\n(0010,0010) PN [Secret^Name]\n(0010,0020) LO [{1}]\n"
        "(0010,0030) DA [19500101]\n(0010,0040) CS [O]\n(0020,000d) UI [2.25.{4}]\n"
        "(0032,1060) LO [treatment]\n(0040,0100) SQ\n(fffe,e000) -\n(0008,0060) CS [RTIMAGE]\n"
        "(0040,0001) AE [LINAC1]\n(0040,0002) DA [{2}]\n(0040,0003) TM [{3}]\n"
        "(0040,0006) PN [A^B]\n(0040,0007) LO [fraction]\n(0040,0009) SH [{0}]\n"
        "(fffe,e00d) -\n(fffe,e0dd) -\n(0040,1001) SH [{0}]\n",
        name, id, day, time, std::hash<std::string>()(name));
    const RunResult made = plumb::Run({"/usr/bin/dump2dcm", text.string(),
                                       (folder_ / "worklists/CLINIC" / (name + ".wl")).string()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  void StartWorklist() {
    worklist_ = std::make_unique<Process>(std::vector<std::string>{"/usr/bin/wlmscpfs", "-dfp",
                                                                   (folder_ / "worklists").string(),
                                                                   std::to_string(worklist_port_)});
    for (int i = 0; i < 200; ++i) {
      const Descriptor probe(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
      sockaddr_in to{};
      to.sin_family = AF_INET;
      to.sin_port = htons(static_cast<std::uint16_t>(worklist_port_));
      to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
      if (::connect(probe.get(), reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    ADD_FAILURE() << "wlmscpfs does not listen";
  }
  /// Orthanc with its plug-in for worklists, over the same entries. False where it is missing.
  bool StartOrthanc() {
    const std::string program = "/usr/sbin/Orthanc",
                      plugin = "/usr/share/orthanc/plugins/libModalityWorklists.so";
    if (!fs::exists(program) || !fs::exists(plugin)) return false;
    const json config = {
        {"StorageDirectory", (folder_ / "orthanc").string()},
        {"IndexDirectory", (folder_ / "orthanc").string()},
        {"HttpServerEnabled", false},
        {"DicomPort", worklist_port_},
        {"DicomAet", "CLINIC"},
        {"DicomCheckCalledAet", true},
        {"DicomModalities", {{"plumb", {"PLUMB", "127.0.0.1", 11112}}}},
        {"Plugins", json::array({plugin})},
        {"Worklists", {{"Enable", true}, {"Database", (folder_ / "worklists/CLINIC").string()}}}};
    std::ofstream(folder_ / "orthanc.json") << config.dump();
    worklist_ = std::make_unique<Process>(
        std::vector<std::string>{program, (folder_ / "orthanc.json").string()});
    return worklist_->WaitForStderr("Orthanc has started");
  }
  /// One patient of today whose planning files were imported, a stranger, and one of tomorrow.
  void MakeSteps() {
    SendSmallCt();
    const json plan = ReceivedOf("plan", [](const json& file) { return file["structures"] != ""; });
    ASSERT_EQ(planner_
                  ->Post("/api/v1/patients/" + patient_ + "/planning/received",
                         {{"structures", plan["structures"]}, {"plan", plan["name"]}})
                  .status,
              201);
    AddStep("A1", kId, LocalDay(0), "093000");
    AddStep("A2", "SOMEBODY-ELSE", LocalDay(0), "100000");
    AddStep("A3", kId, LocalDay(1), "093000");
  }
  void ExpectTheOneWhoIsKnown() {
    const json before = planner_->Get("/api/v1/status").json()["session"];
    const json list = Settled("/api/v1/worklist", [](const json&) { return true; });
    EXPECT_TRUE(list["is_on"].get<bool>());
    EXPECT_TRUE(list["fault"].is_null()) << list.dump();
    ASSERT_EQ(list["patients"].size(), 1U) << list.dump();
    EXPECT_EQ(list["patients"][0]["time"], "09:30");
    EXPECT_EQ(list["patients"][0]["patient_code"], "CT-1");
    EXPECT_EQ(list["patients"][0]["patient_id"], patient_);
    EXPECT_EQ(list["unknown"], 1);
    EXPECT_EQ(list.dump().find(kId), std::string::npos);
    EXPECT_EQ(planner_->Get("/api/v1/status").json()["session"], before) << "it changes none";
    EXPECT_EQ(plumbd_->log().find(kId), std::string::npos);
  }

  std::unique_ptr<Process> worklist_;
};

TEST_F(DaemonWorklistTest, TodaysPatientsAreThoseWhoseHashIsKnown) {
  if (!IsInstalled()) PLUMB_SKIP("DCMTK's programs are not installed: apt install dcmtk");
  MakeSteps();
  StartWorklist();
  ExpectTheOneWhoIsKnown();
}

TEST_F(DaemonWorklistTest, OrthancIsAskedAsWell) {
  if (!IsInstalled()) PLUMB_SKIP("DCMTK's programs are not installed: apt install dcmtk");
  MakeSteps();
  if (!StartOrthanc()) PLUMB_SKIP("Orthanc is not installed: apt install orthanc");
  ExpectTheOneWhoIsKnown();
}

TEST_F(DaemonWorklistTest, AServerThatIsNotThereIsSaidAndHoldsNothingUp) {
  const json list = Settled("/api/v1/worklist", [](const json&) { return true; });
  EXPECT_TRUE(list["is_on"].get<bool>());
  EXPECT_TRUE(list["patients"].empty());
  EXPECT_EQ(list["fault_message"]["id"], "dicom.no_association") << list.dump();
  EXPECT_EQ(planner_->Get("/api/v1/patients").status, 200);
}

}  // namespace
}  // namespace plumb
