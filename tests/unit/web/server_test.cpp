// What a hostile or clumsy client sends, on the wire.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <malloc.h>
#include <sys/resource.h>

#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"
#include "web/http/connection_table.hpp"

namespace plumb::test {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

class ServerTest : public WebTest {
 protected:
  int StatusOf(const std::string& bytes) {
    HttpConnection connection(port_);
    connection.Send(bytes);
    return connection.Read().status;
  }
  void ExpectAlive() { EXPECT_EQ(HttpClient(port_).Get("/health").status, 200); }
};

TEST_F(ServerTest, EveryAnswerCarriesTheSecurityHeaders) {
  Start();
  HttpClient client(port_);
  for (const char* path :
       {"/", "/health", "/result", "/nothing", "/api/v1/status", "/assets/nothing.js"}) {
    const HttpAnswer answer = client.Get(path);
    const std::string policy = answer.Header("content-security-policy");
    EXPECT_THAT(policy, HasSubstr("default-src 'none'")) << path;
    EXPECT_THAT(policy, ::testing::Not(HasSubstr("unsafe"))) << path;
    EXPECT_EQ(answer.Header("x-content-type-options"), "nosniff") << path;
    EXPECT_EQ(answer.Header("x-frame-options"), "DENY") << path;
    EXPECT_EQ(answer.Header("referrer-policy"), "same-origin") << path;
    EXPECT_EQ(answer.Header("cache-control"), "no-store") << path;
  }
}

TEST_F(ServerTest, PageHasNoInlineScriptAndItsFilesAreCachedForEver) {
  Start();
  HttpClient client(port_);
  const HttpAnswer page = client.Get("/");
  EXPECT_THAT(page.body, HasSubstr("Research use only."));
  EXPECT_THAT(page.body, ::testing::Not(HasSubstr("<style")));
  const std::size_t at = page.body.find("/assets/app.");
  ASSERT_NE(at, std::string::npos);
  const std::string script = page.body.substr(at, page.body.find('"', at) - at);
  const HttpAnswer plain = client.Get(script);
  EXPECT_EQ(plain.status, 200);
  EXPECT_THAT(plain.Header("cache-control"), HasSubstr("immutable"));
  EXPECT_EQ(plain.Header("content-encoding"), "");
  client.extra_headers["Accept-Encoding"] = "br, gzip";
  const HttpAnswer packed = client.Get(script);
  EXPECT_EQ(packed.Header("content-encoding"), "gzip");
  EXPECT_EQ(packed.body.substr(0, 2), "\x1f\x8b");
}

TEST_F(ServerTest, OnlyKnownHostNamesAreServed) {
  Start([](web::HttpServerOptions& options) { options.host_names = {"plumb.example"}; });
  const auto status = [&](const std::string& host) {
    return StatusOf("GET /health HTTP/1.1\r\n" + host + "Connection: close\r\n\r\n");
  };
  EXPECT_EQ(status("Host: localhost\r\n"), 200);
  EXPECT_EQ(status("Host: 10.0.0.7:8080\r\n"), 200);
  EXPECT_EQ(status("Host: [fe80::1]:80\r\n"), 200);
  EXPECT_EQ(status("Host: Plumb.Example:8080\r\n"), 200);
  EXPECT_EQ(status("Host: evil.example\r\n"), 421);
  EXPECT_EQ(status("Host: localhost.evil.example\r\n"), 421);
  EXPECT_EQ(status("Host: localhost:80@evil.example\r\n"), 421);
  EXPECT_EQ(status(""), 400);
  EXPECT_EQ(status("Host: localhost\r\nHost: evil.example\r\n"), 400);
}

TEST_F(ServerTest, MalformedRequestsNeitherCrashNorHang) {
  Start();
  EXPECT_THAT(StatusOf("\r\n\r\n\r\nGARBAGE\r\n\r\n"), AnyOf(0, 400));
  EXPECT_THAT(StatusOf("GET\r\n\r\n"), AnyOf(0, 400));
  EXPECT_THAT(StatusOf(std::string("GET /\0 HTTP/1.1\r\nHost: localhost\r\n\r\n", 36)),
              AnyOf(0, 200, 400, 404));
  EXPECT_THAT(StatusOf("GET / HTTP/9.9\r\nHost: localhost\r\n\r\n"), AnyOf(0, 400, 505));
  EXPECT_THAT(
      StatusOf("GET / HTTP/1.1\r\nHost: localhost\r\nX-Evil: a\x01b\r\nConnection: close\r\n\r\n"),
      AnyOf(0, 400));
  EXPECT_THAT(
      StatusOf("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Length: -5\r\n\r\n"),
      AnyOf(0, 400, 413));
  EXPECT_THAT(StatusOf("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Length: "
                       "99999999999999999999\r\n\r\n"),
              AnyOf(0, 400, 413));
  EXPECT_THAT(StatusOf("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Length: "
                       "5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
              AnyOf(0, 400));
  EXPECT_THAT(StatusOf("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
                       "application/json\r\nTransfer-Encoding: chunked\r\n\r\nZZ\r\n"),
              AnyOf(0, 400));
  ExpectAlive();
}

// The library answers what it cannot read by itself, before any code of ours, and has no place for
// headers of ours. Such an answer is a fixed text: nothing of the request is in it, and the
// connection ends.
TEST_F(ServerTest, WhatTheLibraryRefusesByItselfGivesNothingBack) {
  Start();
  const std::string probe = "<script>alert(1)</script>";
  for (const std::string& request :
       {"GET /" + probe + " HTTP/1.1 " + probe + "\r\nHost: localhost\r\n\r\n",
        "GET / HTTP/9.9\r\nHost: " + probe + "\r\n\r\n",
        "GET / HTTP/1.1\r\n" + probe + "\r\nHost: localhost\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + probe + "\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + probe + std::string(64 << 10, 'x') +
            "\r\n\r\n"}) {
    HttpConnection connection(port_);
    connection.Send(request);
    const HttpAnswer answer = connection.Read();
    EXPECT_THAT(answer.body, ::testing::Not(HasSubstr("script"))) << request.substr(0, 60);
    for (const auto& [name, value] : answer.headers)
      EXPECT_THAT(value, ::testing::Not(HasSubstr("script"))) << name;
    EXPECT_THAT(answer.status, AnyOf(0, 400, 404, 413, 414, 421, 431, 505))
        << request.substr(0, 60);
    if (answer.Header("content-security-policy").empty()) {
      EXPECT_TRUE(connection.IsClosedBySoon()) << request.substr(0, 60);
    }
  }
  ExpectAlive();
}

TEST_F(ServerTest, OversizedPartsAreRefused) {
  Start();
  EXPECT_THAT(StatusOf("GET /" + std::string(100000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n"),
              AnyOf(0, 400, 414));
  EXPECT_EQ(StatusOf("GET /" + std::string(1000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n"),
            400);
  EXPECT_THAT(StatusOf("GET / HTTP/1.1\r\nHost: localhost\r\nX-Big: " + std::string(100000, 'a') +
                       "\r\n\r\n"),
              AnyOf(0, 431));
  EXPECT_EQ(StatusOf("POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
                     "application/json\r\nContent-Length: 10000000\r\n\r\n"),
            413);
  ExpectAlive();
}

TEST_F(ServerTest, ABodyInEndlessChunksIsCutOff) {
  Start();
  HttpConnection connection(port_);
  connection.Send(
      "POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: "
      "application/json\r\nTransfer-Encoding: chunked\r\n\r\n");
  const std::string chunk = "1000\r\n" + std::string(0x1000, 'x') + "\r\n";
  int sent = 0;
  while (sent < 100000 && connection.Send(chunk)) ++sent;
  EXPECT_LT(sent, 100000);
  ExpectAlive();
}

TEST_F(ServerTest, PipelinedRequestsAreAnsweredInOrder) {
  Start();
  HttpConnection connection(port_);
  std::string requests;
  for (int i = 0; i < 20; ++i)
    requests += i % 2 == 0 ? "GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"
                           : "GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n";
  connection.Send(requests);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(connection.Read().status, i % 2 == 0 ? 200 : 404) << i;
}

TEST_F(ServerTest, ARequestThatDripsIsCutOffInTheEnd) {
  Start([](web::HttpServerOptions& options) {
    options.request_timeout = std::chrono::seconds(3600);
  });
  HttpConnection drip(port_);
  drip.Send("GET / HTTP/1.1\r\nHost: loc");
  ExpectAlive();  // the drip's bytes have arrived before this answer
  skipped_s_ = 61;
  EXPECT_TRUE(drip.IsClosedBySoon());
  ExpectAlive();
}

TEST_F(ServerTest, AnIdleConnectionIsClosed) {
  Start([](web::HttpServerOptions& options) { options.request_timeout = std::chrono::seconds(1); });
  HttpConnection idle(port_);
  EXPECT_TRUE(idle.IsClosedBySoon());
}

TEST_F(ServerTest, ASlowHeadEndsInTenSecondsUnlessOneIsLoggedIn) {
  Start([](web::HttpServerOptions& options) {
    options.request_timeout = std::chrono::seconds(3600);
  });
  SetUpAccounts();
  const HttpClient client = LoggedIn("technician");
  HttpConnection slow(port_), known(port_), kept(port_);
  for (HttpConnection* connection : {&known, &kept}) {
    connection->Send("GET /api/v1/session HTTP/1.1\r\nHost: localhost\r\n" +
                     (connection == &known ? "Cookie: " + client.cookie + "\r\n" : "") + "\r\n");
    EXPECT_EQ(connection->Read().status, connection == &known ? 200 : 401);
  }
  for (HttpConnection* connection : {&slow, &known, &kept})
    connection->Send("GET /health HTTP/1.1\r\nHo");
  ExpectAlive();  // what was sent has arrived before this answer
  skipped_s_ = 6;
  ::usleep(1'500'000);  // longer than the server takes between two looks
  ExpectAlive();
  for (HttpConnection* connection : {&slow, &known, &kept})
    EXPECT_TRUE(connection->Send("s")) << "eight seconds are in time";
  skipped_s_ = 12;
  EXPECT_TRUE(slow.IsClosedBySoon());
  EXPECT_TRUE(kept.IsClosedBySoon()) << "a further request of a stranger";
  EXPECT_TRUE(known.Send("t: localhost\r\n\r\n"));
  EXPECT_EQ(known.Read().status, 200);
}

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

TEST_F(ServerTest, AnAddressInUseIsSaid) {
  Start();
  web::HttpServerOptions options;
  options.port = port_;
  try {
    const web::HttpServer second(service_.services(), options);
    FAIL() << "two servers on one port";
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr(std::to_string(port_)));
  }
  options.port = 0;
  options.address = "not an address";
  EXPECT_THROW(web::HttpServer(service_.services(), options), IoError);
}

/// The server over TLS with its own certificate, as openssl sees it.
class TlsTest : public ServerTest {
 protected:
  void SetUp() override {
    ASSERT_EQ(std::system("openssl version > /dev/null 2>&1"), 0)
        << "no openssl (Debian package openssl)";
    identity_ = web::MakeTlsIdentity({"plumb.example"});
    std::ofstream(folder_ / "certificate.pem") << identity_.certificate_pem;
    Start([&](web::HttpServerOptions& options) { options.tls = identity_; });
  }

  /// What `openssl s_client` says when it sends the text. @param options  Of its command line.
  std::string Speak(const std::string& options, const std::string& text) {
    std::ofstream(folder_ / "request") << text;
    const std::string answer_file = (folder_ / "answer").string();
    const std::string command = "timeout 60 openssl s_client " + options + " -CAfile " +
                                (folder_ / "certificate.pem").string() +
                                " -connect 127.0.0.1:" + std::to_string(port_) + " < " +
                                (folder_ / "request").string() + " > " + answer_file + " 2>&1";
    exit_code_ = std::system(command.c_str());
    std::ifstream in(answer_file);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  /// True if this openssl as a server and as a client speak a version with each other.
  [[nodiscard]] bool CanSpeak(const std::string& version, const std::string& ciphers) const {
    const std::string script =
        "cd " + folder_.path().string() +
        " && rm -f server && openssl req -x509 -newkey rsa:2048 -nodes -keyout key -out cert -subj "
        "/CN=x"
        " && { timeout 60 openssl s_server -accept 127.0.0.1:0 -cert cert -key key -www " +
        version + ciphers +
        " > server & } && for i in $(seq 300); do grep -q ^ACCEPT server && break; sleep 0.1; done"
        " ; echo | timeout 60 openssl s_client " +
        version + ciphers +
        " -connect 127.0.0.1:$(sed -n 's/^ACCEPT.*://p' server) > client"
        " ; kill $! ; grep '^New, TLSv1' client";
    return std::system(("{ " + script + "; } > /dev/null 2>&1").c_str()) == 0;
  }

  const std::string kHealth =
      "GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  plumb::testing::TempFolder folder_;
  web::TlsIdentity identity_;
  int exit_code_ = -1;
};

TEST_F(TlsTest, VersionsBefore12AreRefusedAnd12And13AreSpoken) {
  // Level 0: the client itself would speak the old ones.
  const std::string old = " -quiet -cipher ALL:@SECLEVEL=0";
  for (const char* version : {"-tls1", "-tls1_1"}) {
    EXPECT_TRUE(CanSpeak(version, " -cipher ALL:@SECLEVEL=0")) << version << " with itself";
    EXPECT_THAT(Speak(version + old, kHealth), ::testing::Not(HasSubstr("HTTP/1.1"))) << version;
    EXPECT_NE(exit_code_, 0) << version;
  }
  for (const char* version : {"-tls1_2", "-tls1_3"}) {
    EXPECT_THAT(Speak(version + std::string(" -quiet"), kHealth), HasSubstr("HTTP/1.1 200"))
        << version;
  }
  EXPECT_THAT(Speak("-tls1_2 -quiet -cipher AES128-GCM-SHA256", kHealth),
              ::testing::Not(HasSubstr("HTTP/1.1")))
      << "no forward secrecy";
  EXPECT_THAT(Speak("-tls1_2 -quiet -cipher ALL:eNULL:@SECLEVEL=0 -no_tls1_2 -tls1_1", kHealth),
              ::testing::Not(HasSubstr("HTTP/1.1")));
}

TEST_F(TlsTest, TheCertificateHasTheNamesAndTheFingerprintThatAreTold) {
  EXPECT_THAT(Speak("-verify_return_error -verify_hostname plumb.example", kHealth),
              HasSubstr("Verify return code: 0"));
  EXPECT_THAT(Speak("-verify_return_error -verify_ip 127.0.0.1", kHealth),
              HasSubstr("Verify return code: 0"));
  (void)Speak("-verify_return_error -verify_hostname other.example", kHealth);
  EXPECT_NE(exit_code_, 0);
  ASSERT_EQ(std::system(("openssl x509 -noout -sha256 -fingerprint -in " +
                         (folder_ / "certificate.pem").string() + " > " +
                         (folder_ / "fingerprint").string())
                            .c_str()),
            0);
  std::ifstream in(folder_ / "fingerprint");
  const std::string reported((std::istreambuf_iterator<char>(in)), {});
  EXPECT_THAT(reported, HasSubstr("=" + identity_.fingerprint));
  EXPECT_EQ(identity_.fingerprint.size(), 95U);
  const std::string request =
      "GET /api/v1/session HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  EXPECT_THAT(Speak("-quiet", request), HasSubstr(identity_.fingerprint))
      << "the set-up page shows it";
}

TEST_F(TlsTest, BrowsersAreToldToComeBackByTlsAndCookiesGoNoOtherWay) {
  const std::string body =
      nlohmann::json{{"code", setup_code_}, {"name", "eve"}, {"password", kPassword}}.dump();
  const std::string answer =
      Speak("-quiet -verify_return_error",
            "POST /api/v1/setup HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n"
            "Content-Type: application/json\r\nOrigin: https://localhost\r\nContent-Length: " +
                std::to_string(body.size()) + "\r\n\r\n" + body);
  EXPECT_THAT(answer, HasSubstr("HTTP/1.1 200"));
  EXPECT_THAT(answer, HasSubstr("Strict-Transport-Security: max-age="));
  EXPECT_THAT(answer, HasSubstr("__Host-plumb_session="));
  EXPECT_THAT(answer, HasSubstr("__Host-plumb_device_"));
  std::size_t secure = 0;
  for (std::size_t at = answer.find("; Secure"); at != std::string::npos;
       at = answer.find("; Secure", at + 1))
    ++secure;
  EXPECT_EQ(secure, 2U) << "of both cookies";
  EXPECT_EQ(StatusOf("GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"), 0)
      << "no answer without TLS";
}

TEST_F(ServerTest, WithoutTlsNobodyIsToldToComeBackByIt) {
  Start();
  const HttpAnswer answer = HttpClient(port_).Get("/health");
  EXPECT_EQ(answer.Header("strict-transport-security"), "");
  EXPECT_EQ(HttpClient(port_).Get("/api/v1/session").json()["certificate"], "");
}

TEST(TlsIdentityTest, WhatIsNoPairOfCertificateAndKeyIsRefusedByName) {
  const web::TlsIdentity one = web::MakeTlsIdentity({}), other = web::MakeTlsIdentity({});
  const auto complaint = [](const std::string& certificate, const std::string& key) {
    return plumb::testing::MessageOf<DataError>(
        [&] { (void)web::CheckedTlsIdentity(certificate, key, "/etc/cert.pem"); });
  };
  EXPECT_THAT(complaint("-----BEGIN NONSENSE-----\n", one.key_pem), HasSubstr("/etc/cert.pem"));
  EXPECT_THAT(complaint("", one.key_pem), HasSubstr("no certificate"));
  EXPECT_THAT(complaint(one.certificate_pem, ""), HasSubstr("no key"));
  EXPECT_THAT(complaint(one.certificate_pem, other.key_pem), HasSubstr("not that of"));
  const std::string both = one.certificate_pem + one.key_pem;
  EXPECT_EQ(web::CheckedTlsIdentity(both, both, "").fingerprint, one.fingerprint);
  EXPECT_NE(one.fingerprint, other.fingerprint);
}

}  // namespace
}  // namespace plumb::test
