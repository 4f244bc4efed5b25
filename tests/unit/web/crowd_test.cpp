// SPDX-License-Identifier: Apache-2.0
// Many connections, and clients that read slowly.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <malloc.h>
#include <sys/resource.h>

#include <fstream>

#include "tests/unit/web/server_fixture.hpp"
#include "web/http/connection_table.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

/// Asks for maps of any size; /maps/N has N bytes.
class SlowReaderTest : public ServerTest {
 protected:
  static constexpr std::size_t kMega = std::size_t{1} << 20;

  void SetUp() override {
    Start([](web::HttpServerOptions& options) { options.max_unsent_bytes = 48 * kMega; });
    SetUpAccounts();
    loop_->Do([&] {
      service_.scans.emplace_back().id = "s1";
      service_.make_map = [](const std::filesystem::path&, const std::string& size) {
        return std::string(std::stoul(size), 'm');
      };
    });
    client_ = std::make_unique<HttpClient>(LoggedIn("technician"));
  }

  static std::string PathOf(std::size_t bytes) {
    return "/api/v1/scans/s1/maps/" + std::to_string(bytes);
  }
  /// Reads the head of the answer and then nothing more.
  [[nodiscard]] HttpConnection AskedAndUnread(std::size_t bytes) const {
    HttpConnection connection(port_);
    connection.SetReceiveBuffer(4096);
    connection.Send("GET " + PathOf(bytes) +
                    " HTTP/1.1\r\nHost: localhost\r\nCookie: " + client_->cookie + "\r\n\r\n");
    EXPECT_THAT(connection.ReadUntil("\r\n\r\n"), HasSubstr("200 OK"));
    return connection;
  }

  std::unique_ptr<HttpClient> client_;
};

TEST_F(SlowReaderTest, AnswersThatWaitAreBoundedAndSmallOnesAlwaysAdmitted) {
  EXPECT_EQ(client_->Get(PathOf(48 * kMega + 1)).status, 503);
  EXPECT_EQ(client_->Get(PathOf(48 * kMega)).status, 200);
  {
    const HttpConnection slow = AskedAndUnread(40 * kMega);
    EXPECT_EQ(client_->Get(PathOf(8 * kMega)).body.size(), 8 * kMega);
    const HttpAnswer refused = client_->Get(PathOf(8 * kMega + 1));
    EXPECT_EQ(refused.status, 503);
    EXPECT_EQ(refused.Header("retry-after"), "5");
    EXPECT_EQ(refused.Header("x-content-type-options"), "nosniff");
    const HttpConnection another = AskedAndUnread(8 * kMega);
    EXPECT_EQ(client_->Get(PathOf(kMega)).status, 200);
    EXPECT_EQ(client_->Get(PathOf(kMega + 1)).status, 503);
  }
  // Both have closed their connections. Each request lets the server's loop notice it.
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  int status = 503;
  while (status == 503 && std::chrono::steady_clock::now() < until)
    status = client_->Get(PathOf(48 * kMega)).status;
  EXPECT_EQ(status, 200);
}

TEST_F(SlowReaderTest, AnAnswerIsHeldOnce) {
  // Allocations above 32 MiB are mapped separately and counted here; under sanitizers it is 0.
  const auto mapped = [] { return mallinfo2().hblkhd; };
  const std::size_t before = mapped();
  const HttpConnection slow = AskedAndUnread(40 * kMega);
  EXPECT_LT(mapped(), before + 60 * kMega);
}

class CrowdTest : public ServerTest {
 protected:
  void SetUp() override {
    rlimit files{};
    getrlimit(RLIMIT_NOFILE, &files);
    files.rlim_cur = std::min<rlim_t>(files.rlim_max, 8192);
    setrlimit(RLIMIT_NOFILE, &files);
    Start();
    SetUpAccounts();
  }
  /// Connections that send nothing, from 18 addresses.
  static std::vector<HttpConnection> Crowd(std::uint16_t port, int count, int addresses = 18) {
    std::vector<HttpConnection> idle;
    for (int i = 0; i < count; ++i)
      idle.emplace_back(port, "127.0.0." + std::to_string(2 + i % addresses));
    return idle;
  }
};

TEST_F(CrowdTest, AThousandIdleConnectionsShutOutNeitherThisMachineNorTheLoggedInNorAStranger) {
  HttpClient client = LoggedIn("technician");
  HttpConnection stream(port_, "127.0.1.1");
  stream.Send("GET /api/v1/events HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie +
              "\r\n\r\n");
  EXPECT_FALSE(stream.ReadUntil("event: status").empty());
  HttpConnection kept(port_, "127.0.1.1");
  const std::string status =
      "GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\nCookie: " + client.cookie + "\r\n\r\n";
  kept.Send(status);
  EXPECT_EQ(kept.Read().status, 200);
  const std::vector<HttpConnection> idle = Crowd(port_, 1000);
  const auto begun = std::chrono::steady_clock::now();
  ExpectAlive();
  EXPECT_TRUE(kept.Send(status));
  EXPECT_EQ(kept.Read().status, 200) << "a connection that a logged-in browser keeps";
  HttpConnection fresh(port_, "127.0.1.2");
  fresh.Send(status);
  EXPECT_EQ(fresh.Read().status, 200) << "a new connection of a logged-in browser";
  HttpConnection stranger(port_, "127.0.1.3");
  stranger.Send("GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(stranger.Read().status, 200) << "somebody who wants to log in";
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(5))
      << "at once, not when the idle ones have timed out";
  loop_->Do([&] { service_.Notify(web::EventKind::kData); });
  EXPECT_FALSE(stream.ReadUntil("event: data").empty()) << "the stream stays";
}

TEST_F(CrowdTest, OneAddressKeepsItsNewestConnections) {
  std::vector<HttpConnection> idle = Crowd(port_, 80, 1);
  ExpectAlive();
  EXPECT_TRUE(idle.front().IsClosedBySoon()) << "the oldest went";
  idle.back().Send("GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(idle.back().Read().status, 200);
}

TEST(ConnectionTableTest, TheLimitsHoldOnBothSides) {
  web::HttpServerOptions options;
  options.max_connections = 10;
  options.max_strangers = 4;
  options.max_strangers_per_address = 3;
  web::ConnectionTable table(options);
  const auto now = std::chrono::steady_clock::now();
  int fd = 0;
  const auto add = [&](const std::string& address, const std::string& user = "") {
    web::Connection* made = table.Add(++fd, address, now + std::chrono::seconds(fd));
    made->user = user;
    return made;
  };
  for (const char* address : {"10.0.0.1", "10.0.0.1", "10.0.0.1", "10.0.0.2"}) add(address);
  EXPECT_EQ(table.NextOverLimit(now + std::chrono::seconds(fd)), nullptr)
      << "four strangers, three of one address";
  for (int i = 0; i < 3; ++i) add("127.0.0.1");
  EXPECT_EQ(table.NextOverLimit(now + std::chrono::seconds(fd)), nullptr)
      << "this machine is no stranger";
  add("10.0.0.2");
  const web::Connection* gone = table.NextOverLimit(now + std::chrono::seconds(fd));
  ASSERT_NE(gone, nullptr);
  EXPECT_EQ(gone->fd, 1) << "the oldest of the address with the most";
  EXPECT_EQ(table.NextOverLimit(now + std::chrono::seconds(fd)), nullptr)
      << "one was enough, though it is not closed yet";
  add("127.0.0.1");
  EXPECT_EQ(table.NextOverLimit(now + std::chrono::seconds(fd))->address, "127.0.0.1")
      << "four of one address";
  for (int i = 0; i < 3; ++i) add("10.0.0.3", i < 2 ? "anna" : "bob")->receiving = i != 0;
  EXPECT_EQ(table.NextOverLimit(now + std::chrono::seconds(fd)), nullptr)
      << "three logged in: 10 - 4 - 3";
  add("10.0.0.4", "bob");
  add("10.0.0.4", "anna");
  const web::Connection* over = table.NextOverLimit(now + std::chrono::seconds(fd));
  ASSERT_NE(over, nullptr);
  EXPECT_EQ(over->user, "anna");
  EXPECT_TRUE(over->receiving) << "not the one that is being answered";
}

/// 128 strangers' places, all taken by one connection from each of 128 addresses, a second apart.
class ManyAddressesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    for (int i = 0; i < 128; ++i) {
      Add(fmt::format("10.0.1.{}", i));
      ASSERT_EQ(Closed(), nullptr) << i;
    }
  }
  web::Connection* Add(const std::string& address, const std::string& user = "") {
    now_ += std::chrono::seconds(1);
    web::Connection* made = table_.Add(++last_, address, now_);
    made->user = user;
    return made;
  }
  const web::Connection* Closed() { return table_.NextOverLimit(now_); }

  const web::HttpServerOptions options_;
  web::ConnectionTable table_{options_};
  web::Connection::TimePoint now_ = std::chrono::steady_clock::now();
  int last_ = 0;
};

TEST_F(ManyAddressesTest, TheOldestGoesWhateverTheAddressOfTheNewcomer) {
  for (int i = 0; i < 72; ++i) {
    Add(i % 2 == 0 ? fmt::format("1.0.0.{}", i) : fmt::format("99.0.0.{}", i));
    const web::Connection* closed = Closed();
    ASSERT_NE(closed, nullptr) << i;
    EXPECT_EQ(closed->fd, i + 1) << closed->address;
    EXPECT_EQ(Closed(), nullptr);
  }
}

TEST_F(ManyAddressesTest, OneThatHasJustComeOutlastsThoseThatReadTheirAnswersSlowly) {
  web::ConnectionTable table(options_);
  for (int i = 0; i < 128; ++i) table.Add(i, fmt::format("10.0.1.{}", i), now_)->receiving = false;
  now_ += std::chrono::minutes(1);
  const web::Connection* fresh = table.Add(200, "1.0.0.1", now_);
  const web::Connection* closed = table.NextOverLimit(now_);
  ASSERT_NE(closed, nullptr);
  EXPECT_NE(closed, fresh);
  EXPECT_EQ(closed->fd, 0);
}

TEST_F(ManyAddressesTest, NewConnectionsFromTheAddressOfALoggedInBrowserStay) {
  Add("1.0.0.1", "anna");
  EXPECT_EQ(Closed(), nullptr) << "who is logged in is no stranger";
  // More than anybody else's, and nothing has arrived for long.
  for (int i = 0; i < 8; ++i) {
    Add("1.0.0.1");
    const web::Connection* closed = Closed();
    ASSERT_NE(closed, nullptr) << i;
    EXPECT_NE(closed->address, "1.0.0.1") << i;
  }
  Add("1.0.0.1");
  const web::Connection* closed = Closed();
  ASSERT_NE(closed, nullptr);
  EXPECT_EQ(closed->address, "1.0.0.1") << "no browser opens so many";
  EXPECT_TRUE(closed->user.empty());
}

}  // namespace
}  // namespace plumb::test
