// SPDX-License-Identifier: Apache-2.0
// What takes its time is done beside the loop: lists, files, and writing what is sent. Here the
// work stands still until the test does it.
#include <dlfcn.h>
#include <gmock/gmock.h>
#include <sys/uio.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

namespace {

/// What the kernel says of the part of a file that is in memory.
enum class InMemory { kAsItIs, kNothing, kEndOfFile };
std::atomic<InMemory> in_memory = InMemory::kAsItIs;

}  // namespace

/// In place of the C library's: on some disks nothing is in memory, and some kernels then say that
/// the file ends.
extern "C" ssize_t preadv2(int fd, const iovec* parts, int count, off_t at, int flags) {
  static auto* const kNext = reinterpret_cast<decltype(&preadv2)>(dlsym(RTLD_NEXT, "preadv2"));
  if (in_memory == InMemory::kAsItIs) return kNext(fd, parts, count, at, flags);
  if (in_memory == InMemory::kEndOfFile) return 0;
  errno = EAGAIN;
  return -1;
}

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
  /// @return False once `is_over`, after which somebody has released the semaphore.
  bool WaitUntilHeld(const std::atomic<bool>& is_over = false) {
    while (NumHeld() == 0) {
      if (is_over) return false;
      AwaitAsked();
    }
    return true;
  }
  void WaitUntilRefused(int times) {
    for (int refused = 0; refused < times;) {
      AwaitAsked();
      loop_->Do([&] { refused = service_.num_refused_background_work; });
    }
  }
  void AwaitAsked() {
    if (!service_.asked_for_background_work.try_acquire_for(std::chrono::seconds(60)))
      throw std::runtime_error("no background work was requested within 60 s");
  }

  /// A file of this size for the page, on a disk that is waited for. @return Its path there.
  std::string MakeFile(std::size_t bytes) {
    std::filesystem::create_directories(folder_ / "scan/scene");
    std::ofstream(folder_ / "scan/scene/mesh.ply") << std::string(bytes, 'm');
    AddScanIn(folder_ / "scan");
    in_memory = InMemory::kNothing;
    return "/api/v1/scans/s1/files/mesh.ply";
  }
  void TearDown() override {
    in_memory = InMemory::kAsItIs;
    WebTest::TearDown();
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

TEST_F(AsideTest, AFileThatTheDiskHasToGiveKeepsNobodyWaiting) {
  constexpr std::size_t kBytes = 1'000'000;
  const std::string path = MakeFile(kBytes);
  const std::string cookie = engineer_->cookie;
  std::atomic<bool> has_arrived = false;
  HttpAnswer file;
  std::jthread asking([&] {
    HttpClient other(port_);
    other.cookie = cookie;
    file = other.Get(path);
    has_arrived = true;
    service_.asked_for_background_work.release();
  });
  std::size_t pieces = 0;
  while (pieces < 1000 && WaitUntilHeld(has_arrived)) {
    ASSERT_EQ(engineer_->Get("/health").status, 200) << "the disk stands still";
    const std::size_t done = DoHeld();
    EXPECT_LE(done, 1U) << "one piece at a time";
    pieces += done;
  }
  asking.join();
  EXPECT_EQ(file.status, 200);
  EXPECT_EQ(file.body, std::string(kBytes, 'm'));
  EXPECT_GE(pieces, 8U);
}

TEST_F(AsideTest, AFileWaitsForItsTurnWhereTooMuchWaitsAlready) {
  const std::string path = MakeFile(300'000);
  const std::string cookie = engineer_->cookie;
  HttpAnswer file;
  std::jthread asking([&] {
    HttpClient other(port_);
    other.cookie = cookie;
    file = other.Get(path);
  });
  WaitUntilHeld();
  loop_->Do([&] { service_.refuse_background_work = true; });
  DoHeld();  // it is opened, and its first piece finds no place
  WaitUntilRefused(3);
  EXPECT_EQ(engineer_->Get("/health").status, 200);
  loop_->Do([&] { service_.refuse_background_work = service_.hold_background_work = false; });
  asking.join();
  EXPECT_EQ(file.body, std::string(300'000, 'm'));
}

TEST_F(AsideTest, AFileIsReadWhileAnUpdateTakesItsMinutes) {
  loop_->Do([&] { service_.hold_only = web::BackgroundPool::kFiles; });
  EXPECT_EQ(engineer_->Get(MakeFile(300'000)).body, std::string(300'000, 'm'));
  EXPECT_EQ(NumHeld(), 0U);
}

TEST_F(AsideTest, AFileEndsWhereTheDiskSaysSo) {
  loop_->Do([&] { service_.hold_background_work = false; });
  const std::string path = MakeFile(300'000);
  in_memory = InMemory::kEndOfFile;
  EXPECT_EQ(engineer_->Get(path).body, std::string(300'000, 'm'));
}

TEST_F(AsideTest, AFileThatEndsTooSoonEndsItsConnectionOnly) {
  const std::string path = MakeFile(1'000'000);
  HttpConnection connection(port_);
  connection.Send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\nCookie: " + engineer_->cookie +
                  "\r\n\r\n");
  WaitUntilHeld();
  DoHeld();  // it is opened
  WaitUntilHeld();
  std::filesystem::resize_file(folder_ / "scan/scene/mesh.ply", 0);
  DoHeld();
  EXPECT_TRUE(connection.IsClosedBySoon());
  EXPECT_EQ(engineer_->Get("/health").status, 200);
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
    service_.asked_for_background_work.release();
  });
  WaitUntilHeld();
  for (int i = 0; i < 200; ++i)
    ASSERT_EQ(engineer_->Get("/health").status, 200) << "the disk stands still";
  EXPECT_EQ(NumHeld(), 1U) << "one piece at a time";
  EXPECT_FALSE(sent) << "the rest waits with who sends it";
  std::size_t pieces = 0;
  while (pieces < 1000 && WaitUntilHeld(answered)) {
    const std::size_t done = DoHeld();
    EXPECT_LE(done, 1U);
    pieces += done;
  }
  sending.join();
  EXPECT_EQ(answer.status, 200);
  EXPECT_GE(pieces, 30U) << "in pieces of about a megabyte";
  loop_->Do([&] { EXPECT_EQ(service_.uploaded_bytes, bundle.size()); });
  while (DoHeld() > 0) {  // its removal
  }
}

TEST_F(AsideTest, ASecondUploadIsToldWhetherTheFirstArrivesOrIsWorkedOn) {
  loop_->Do([&] { service_.hold_completions = true; });
  const auto send = [&](const std::string& name) {
    HttpConnection connection(port_);
    connection.Send("POST /api/v1/update/bundles/" + name +
                    " HTTP/1.1\r\nHost: localhost\r\nCookie: " + engineer_->cookie +
                    "\r\nX-CSRF-Token: " + engineer_->csrf_token +
                    "\r\nContent-Type: application/octet-stream\r\nContent-Length: 5004\r\n\r\n" +
                    "hsqs" + std::string(5000, 'x'));
    return connection;
  };
  HttpConnection first = send("a.raucb");
  WaitUntilHeld();
  EXPECT_THAT(send("b.raucb").Read().body, ::testing::HasSubstr("another file is being uploaded"));
  DoHeld();
  for (bool is_worked_on = false; !is_worked_on;)
    loop_->Do([&] { is_worked_on = !service_.held.empty(); });
  const HttpAnswer refused = send("b.raucb").Read();
  EXPECT_EQ(refused.status, 409);
  EXPECT_THAT(refused.body, ::testing::HasSubstr("is still being worked on"));
  loop_->Do([&] {
    for (const auto& finish : std::exchange(service_.held, {})) finish();
  });
  EXPECT_EQ(first.Read().status, 200);
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
