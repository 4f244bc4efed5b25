// SPDX-License-Identifier: Apache-2.0
// What takes its time is done beside the loop: lists, files, and writing what is sent. Here the
// work stands still until the test does it.
#include <gmock/gmock.h>

#include <atomic>
#include <thread>

#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace plumb::test {
namespace {

class AsideTest : public WebTest {
 protected:
  void SetUp() override {
    Start([this](web::HttpServerOptions& options) {
      options.upload_folder = folder_ / "updates";
      options.max_upload_bytes = 64U << 20;
    });
    SetUpAccounts();
    engineer_ = std::make_unique<HttpClient>(LoggedIn("engineer"));
    loop_->Do([&] { service_.hold_background_work = true; });
  }

  /// Does what has been waiting. @return How much that was.
  std::size_t DoHeld() {
    std::size_t count = 0;
    loop_->Do([&] {
      for (const auto& held : std::exchange(service_.held_background_work, {})) held(), ++count;
    });
    return count;
  }
  [[nodiscard]] std::size_t NumHeld() {
    std::size_t count = 0;
    loop_->Do([&] { count = service_.held_background_work.size(); });
    return count;
  }
  void WaitUntilHeld() {
    while (NumHeld() == 0) std::this_thread::yield();
  }

  testing::TempFolder folder_;
  std::unique_ptr<HttpClient> engineer_;
};

TEST_F(AsideTest, AListThatTakesItsTimeKeepsNobodyWaiting) {
  const std::string cookie = engineer_->cookie;
  for (const char* path : {"/api/v1/scans", "/api/v1/patients", "/api/v1/checks", "/result"}) {
    HttpAnswer list;
    std::atomic<bool> listed = false;
    {
      const std::jthread asking([&] {
        HttpClient other(port_);
        other.cookie = cookie;
        list = other.Get(path);
        listed = true;
      });
      WaitUntilHeld();
      EXPECT_EQ(engineer_->Get("/api/v1/status").status, 200)
          << "while " << path << " is being made";
      EXPECT_FALSE(listed) << path;
      DoHeld();
    }
    EXPECT_EQ(list.status, 200) << path;
  }
}

TEST_F(AsideTest, AListForSomebodyWhoIsGoneIsForNobody) {
  {
    HttpConnection gone(port_);
    gone.Send("GET /api/v1/scans HTTP/1.1\r\nHost: localhost\r\nCookie: " + engineer_->cookie +
              "\r\n\r\n");
    WaitUntilHeld();
  }
  DoHeld();
  EXPECT_EQ(engineer_->Get("/api/v1/status").status, 200);
}

TEST_F(AsideTest, TooManyListsAtOnceAreRefused) {
  loop_->Do([&] { service_.refuse_background_work = true; });
  const HttpAnswer answer = engineer_->Get("/api/v1/scans");
  EXPECT_EQ(answer.status, 503);
  EXPECT_NE(answer.Header("retry-after"), "");
}

TEST_F(AsideTest, AnUploadGoesNoFasterThanTheDiskAndKeepsNobodyWaiting) {
  const std::string bundle = "hsqs" + std::string(std::size_t{40} << 20, 'x');
  std::atomic<bool> sent = false, answered = false;
  HttpAnswer answer;
  std::jthread sending([&] {
    HttpConnection connection(port_);
    connection.Send("POST /api/v1/update/bundles/a.raucb HTTP/1.1\r\nHost: localhost\r\nCookie: " +
                    engineer_->cookie + "\r\nX-CSRF-Token: " + engineer_->csrf_token +
                    "\r\nContent-Type: application/octet-stream\r\nContent-Length: " +
                    std::to_string(bundle.size()) + "\r\n\r\n");
    connection.Send(bundle);
    sent = true;
    answer = connection.Read();
    answered = true;
  });
  WaitUntilHeld();
  for (int i = 0; i < 200; ++i)
    ASSERT_EQ(engineer_->Get("/health").status, 200) << "the disk stands still";
  EXPECT_EQ(NumHeld(), 1U) << "one piece at a time";
  EXPECT_FALSE(sent) << "the rest waits with who sends it";
  std::size_t pieces = 0;
  while (!answered && pieces < 1000) {
    const std::size_t done = DoHeld();
    EXPECT_LE(done, 1U);
    pieces += done;
    if (sent && done == 0) std::this_thread::yield();
  }
  sending.join();
  EXPECT_EQ(answer.status, 200);
  EXPECT_GE(pieces, 30U) << "in pieces of about a megabyte";
  loop_->Do([&] { EXPECT_EQ(service_.uploaded_bytes, bundle.size()); });
  while (DoHeld() > 0) {  // its removal
  }
}

TEST_F(AsideTest, AnUploadThatTheDiskDoesNotTakeIsRefused) {
  loop_->Do([&] { service_.refuse_background_work = true; });
  HttpConnection connection(port_);
  connection.Send("POST /api/v1/update/bundles/a.raucb HTTP/1.1\r\nHost: localhost\r\nCookie: " +
                  engineer_->cookie + "\r\nX-CSRF-Token: " + engineer_->csrf_token +
                  "\r\nContent-Type: application/octet-stream\r\nContent-Length: 5004\r\n\r\nhsqs" +
                  std::string(5000, 'x'));
  EXPECT_EQ(connection.Read().status, 507);
}

}  // namespace
}  // namespace plumb::test
