// SPDX-License-Identifier: Apache-2.0
// Files that the interface sends, and those that it takes.
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#include <gmock/gmock.h>

#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

class FilesTest : public WebTest {
 protected:
  void SetUp() override {
    Start();
    SetUpAccounts();
    std::filesystem::create_directories(folder_ / "scan/result");
    std::ofstream(folder_ / "scan/result/result.json") << R"({"format": 1})";
    std::ofstream(folder_ / "secret") << "secret";
    std::filesystem::create_symlink(folder_ / "secret", folder_ / "scan/result/overlay.png");
    std::filesystem::create_directories(folder_ / "scan/result/error_map.png");
    AddScanIn(folder_ / "scan");
  }
  plumb::testing::TempFolder folder_;
};

TEST_F(FilesTest, ResultsAreDownloadedUnderASafeName) {
  HttpClient client = LoggedIn("technician");
  EXPECT_EQ(client.Get("/api/v1/results/s1").body, R"({"format": 1})");
  const HttpAnswer file = client.Get("/api/v1/scans/s1/files/result.json?download");
  EXPECT_EQ(file.body, R"({"format": 1})");
  EXPECT_EQ(file.Header("content-disposition"), "attachment; filename=\"s1_result.json\"");
  EXPECT_EQ(file.Header("cache-control"), "no-store");
}

TEST_F(FilesTest, APictureIsDrawnInTheLanguageThatIsAskedFor) {
  HttpClient client = LoggedIn("technician");
  const std::string code(Catalogues().back()->code);
  const std::string files = "/api/v1/scans/s1/files/";
  EXPECT_EQ(client.Get(files + "overlay.png?language=" + code).status, 404)
      << "it cannot be drawn, and the stored one is a link";
  loop_->Do([&] { service_.draws_pictures = true; });
  const HttpAnswer overlay = client.Get(files + "overlay.png?download&language=" + code);
  EXPECT_EQ(overlay.body, "overlay in " + std::string(Catalogues().back()->name));
  EXPECT_EQ(overlay.Header("content-type"), "image/png");
  EXPECT_EQ(overlay.Header("content-disposition"), "attachment; filename=\"s1_overlay.png\"");
  const HttpAnswer map = client.Get(files + "error_map.png?language=en");
  EXPECT_EQ(map.body, "error map in English");
  EXPECT_EQ(map.Header("content-disposition"), "");
  EXPECT_EQ(client.Get(files + "overlay.png?language=xx").status, 400);
  EXPECT_EQ(client.Get(files + "overlay.png").status, 404) << "without a language the stored one";
  EXPECT_EQ(client.Get(files + "result.json?language=" + code).body, R"({"format": 1})");
}

TEST_F(FilesTest, NoPathLeadsOutOfAScan) {
  HttpClient client = LoggedIn("technician");
  for (const char* path :
       {"/api/v1/scans/s1/files/../../secret", "/api/v1/scans/s1/files/..%2f..%2fsecret",
        "/api/v1/scans/s1/files/..", "/api/v1/scans/s1/files/secret",
        "/api/v1/scans/../scans/s1/files/result.json", "/api/v1/scans/s1/files//etc/passwd",
        "/assets/../../etc/passwd", "/assets/..%2f..%2fetc%2fpasswd", "/%2e%2e/etc/passwd",
        "/api/v1/scans/s1/files/result.json%00.png"}) {
    EXPECT_EQ(client.Get(path).status, 404) << path;
  }
  EXPECT_EQ(client.Get("/api/v1/scans/s1/files/overlay.png").status, 404) << "a link";
  EXPECT_EQ(client.Get("/api/v1/scans/s1/files/error_map.png").status, 404) << "a folder";
}

TEST_F(FilesTest, DiagnosticsAreSentOnceAndRemoved) {
  std::ofstream(folder_ / "bundle.tar") << "bundle";
  loop_->Do([&] { service_.diagnostics_file = folder_ / "bundle.tar"; });
  HttpClient engineer = LoggedIn("engineer");
  const HttpAnswer answer = engineer.Post("/api/v1/diagnostics");
  EXPECT_EQ(answer.body, "bundle");
  EXPECT_THAT(answer.Header("content-disposition"), HasSubstr("plumb-diagnostics.tar"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "bundle.tar"));
}

class UploadTest : public WebTest {
 protected:
  UploadTest() {
    Start([this](web::HttpServerOptions& options) {
      options.upload_folder = folder_ / "updates";
      options.max_upload_bytes = 1 << 20;
    });
    SetUpAccounts();
  }
  std::string Head(const HttpClient& client, const std::string& name, std::size_t bytes) {
    return "POST /api/v1/update/bundles/" + name +
           " HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie +
           "\r\nX-CSRF-Token: " + client.csrf_token +
           "\r\nContent-Type: application/octet-stream\r\nContent-Length: " +
           std::to_string(bytes) + "\r\n\r\n";
  }
  HttpAnswer Send(const HttpClient& client, const std::string& name, const std::string& body) {
    HttpConnection connection(port_);
    connection.Send(Head(client, name, body.size()));
    connection.Send(body);
    return connection.Read();
  }
  [[nodiscard]] std::size_t FilesLeft() const {
    std::size_t count = 0;
    std::error_code error;
    for (std::filesystem::directory_iterator entry(folder_ / "updates", error), end;
         !error && entry != end; ++entry)
      ++count;
    return count;
  }

  /// Waits until the folder has that many files; false if it has not within ten seconds. A file
  /// goes when its request is over, which is after its answer.
  [[nodiscard]] bool ComesToHold(std::size_t files) const {
    for (int ms = 0; ms < 10000 && FilesLeft() != files; ++ms) ::usleep(1000);
    return FilesLeft() == files;
  }

  testing::TempFolder folder_;
};

TEST_F(UploadTest, ABundleGoesToTheDiskAndNothingIsLeftOfIt) {
  const HttpClient engineer = LoggedIn("engineer");
  const std::string bundle = "hsqs" + std::string(900000, 'x');
  EXPECT_EQ(Send(engineer, "plumb-2.raucb", bundle).status, 200);
  loop_->Do([&] {
    EXPECT_EQ(service_.uploaded_bytes, bundle.size());
    EXPECT_THAT(service_.update.bundles, ::testing::Contains("plumb-2.raucb"));
  });
  EXPECT_TRUE(ComesToHold(0)) << "the fake keeps none";
  HttpClient again = LoggedIn("engineer");
  EXPECT_EQ(again.Ask("DELETE", "/api/v1/update/bundles/plumb-2.raucb", "").status, 200);
  EXPECT_EQ(again.Ask("DELETE", "/api/v1/update/bundles/plumb-2.raucb", "").status, 404);
}

TEST_F(UploadTest, APlanningCtReachesTheServiceWithItsChoicesAndNothingIsLeftOfIt) {
  Patient patient;
  patient.id = "p1";
  service_.patients.push_back(patient);
  HttpClient physicist = LoggedIn("physicist");
  physicist.extra_headers["Content-Type"] = "application/octet-stream";
  const std::string path = "/api/v1/patients/p1/planning";
  physicist.extra_headers["X-Plumb-Planning"] =
      "structures_bytes=6&roi=BODY+S%C3%A9&isocentre_of=AP";
  const HttpAnswer answer = physicist.Ask("POST", path, "structplan");
  EXPECT_EQ(answer.status, 201) << answer.body;
  loop_->Do([&] {
    EXPECT_EQ(service_.uploaded_bytes, 10U);
    EXPECT_EQ(service_.sent_planning.structures_bytes, 6U);
    EXPECT_EQ(service_.sent_planning.roi, "BODY S\xC3\xA9");
    EXPECT_EQ(service_.sent_planning.beam, "AP");
    EXPECT_EQ(service_.references.back().id, answer.json()["id"]);
  });
  EXPECT_TRUE(ComesToHold(0)) << "it names the patient";
  physicist.extra_headers["X-Plumb-Planning"] =
      "structures_bytes=0&plan_bytes=4&threshold_hu=-300.5";
  EXPECT_EQ(physicist.Ask("POST", path, "planimages").status, 201);
  loop_->Do([&] {
    EXPECT_EQ(service_.sent_planning.plan_bytes, 4U);
    EXPECT_EQ(service_.sent_planning.threshold_hu, -300.5);
  });
  for (const std::string& bad :
       {std::string("structures_bytes=-1"), std::string("%GG"), std::string("structures_bytes=0"),
        "structures_bytes=1&roi=" + std::string(257, 'x'),
        std::string("structures_bytes=1&threshold_hu=-300"),
        std::string("structures_bytes=1&threshold_hu=-300&plan_bytes=0"),
        std::string("structures_bytes=1&threshold_hu=0.1&plan_bytes=1"),
        std::string("structures_bytes=1&threshold_hu=-900.1&plan_bytes=1"),
        std::string("structures_bytes=1&threshold_hu=nan&plan_bytes=1")}) {
    physicist.extra_headers["X-Plumb-Planning"] = bad;
    EXPECT_EQ(physicist.Ask("POST", path, "x").status, 400) << bad;
  }
  physicist.extra_headers["X-Plumb-Planning"] = "structures_bytes=1";
  EXPECT_EQ(physicist.Ask("POST", "/api/v1/patients/p9/planning", "x").status, 404);
}

TEST_F(UploadTest, WhatIsNoBundleOrTooLargeIsRefused) {
  const HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(Send(engineer, "zip.raucb", "PK" + std::string(5000, 'x')).status, 400);
  EXPECT_EQ(Send(engineer, "name.zip", "hsqs" + std::string(5000, 'x')).status, 400);
  EXPECT_EQ(Send(engineer, "a.raucb", "").status, 411);
  HttpConnection large(port_);
  large.Send(Head(engineer, "large.raucb", std::size_t{2} << 20));
  EXPECT_EQ(large.Read().status, 413);
  EXPECT_TRUE(ComesToHold(0));
}

TEST_F(UploadTest, ABrokenUploadLeavesNothing) {
  const HttpClient engineer = LoggedIn("engineer");
  {
    HttpConnection broken(port_);
    broken.Send(Head(engineer, "broken.raucb", 500000));
    broken.Send("hsqs" + std::string(100000, 'x'));
    EXPECT_TRUE(ComesToHold(1)) << "the upload has begun";
    EXPECT_EQ(Send(engineer, "second.raucb", "hsqs" + std::string(5000, 'x')).status, 409)
        << "one at a time";
  }
  EXPECT_TRUE(ComesToHold(0));
  EXPECT_EQ(Send(engineer, "third.raucb", "hsqs" + std::string(5000, 'x')).status, 200);
}

TEST_F(UploadTest, OnlyAnEngineerSendsBundles) {
  for (const char* name : {"technician", "physicist"})
    EXPECT_EQ(Send(LoggedIn(name), "a.raucb", "hsqs" + std::string(5000, 'x')).status, 403);
  HttpClient logged_out(port_);
  EXPECT_EQ(Send(logged_out, "a.raucb", "hsqs" + std::string(5000, 'x')).status, 401);
  EXPECT_TRUE(ComesToHold(0));
}

TEST_F(FilesTest, WithoutAFolderNoFilesAreTaken) {
  const HttpClient engineer = LoggedIn("engineer");
  HttpConnection connection(port_);
  connection.Send("POST /api/v1/update/bundles/a.raucb HTTP/1.1\r\nHost: localhost\r\nCookie: " +
                  engineer.cookie + "\r\nX-CSRF-Token: " + engineer.csrf_token +
                  "\r\nContent-Type: application/octet-stream\r\nContent-Length: 5\r\n\r\nhsqs!");
  EXPECT_EQ(connection.Read().status, 409);
}

}  // namespace
}  // namespace plumb::test
