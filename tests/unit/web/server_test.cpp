// SPDX-License-Identifier: Apache-2.0
// What a hostile or clumsy client sends, on the wire.
#include <gmock/gmock.h>
#include <malloc.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <fstream>

#include "algo/base/errors.hpp"
#include "tests/unit/web/server_fixture.hpp"

namespace plumb::test {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

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
  for (const std::string& own : web::OwnNames()) {
    EXPECT_EQ(status("Host: " + own + ":8080\r\n"), 200) << own;
    EXPECT_EQ(status("Host: " + own + ".evil.example\r\n"), 421) << own;
  }
  EXPECT_EQ(status("Host: localhost.evil.example\r\n"), 421);
  EXPECT_EQ(status("Host: localhost:80@evil.example\r\n"), 421);
  EXPECT_EQ(status(""), 400);
  EXPECT_EQ(status("Host: localhost\r\nHost: evil.example\r\n"), 400);
}

TEST_F(ServerTest, BothFamiliesAreServedAndAnIpv4AddressReadsAsOne) {
  Start([](web::HttpServerOptions& options) { options.address = "::"; });
  EXPECT_EQ(
      HttpClient(port_)
          .Post("/api/v1/setup", {{"code", "2222-2222"}, {"name", "eve"}, {"password", kPassword}})
          .status,
      403);
  loop_->Do([&] { EXPECT_EQ(service_.audit.back().address, "127.0.0.1"); });
  const int fd = socket(AF_INET6, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in6 here{};
  here.sin6_family = AF_INET6;
  here.sin6_port = htons(port_);
  here.sin6_addr = in6addr_loopback;
  EXPECT_EQ(connect(fd, reinterpret_cast<const sockaddr*>(&here), sizeof here), 0);
  close(fd);
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

/// What another server in front could read in another way is refused, and the connection ends, so
/// that nothing of its body is taken for a request.
TEST_F(ServerTest, ABodyInAnUnknownCodingIsRefusedAndTheConnectionEnds) {
  Start();
  const std::string head =
      "POST /api/v1/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n";
  const std::string body = "2\r\n{}\r\n0\r\n\r\nGET /health HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (const char* const coding :
       {"Transfer-Encoding : chunked\r\nContent-Length: 5\r\n", "Transfer-Encoding: xchunked\r\n",
        "Transfer-Encoding: chunked, identity\r\n", "Transfer-Encoding: gzip, chunked\r\n",
        "Transfer-Encoding: identity\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n",
        "Transfer-Encoding:\x0b"
        "chunked\r\nContent-Length: 5\r\n",
        "Transfer-Encoding: \r\n", "Transfer-Encoding:\r\n chunked\r\n", "Content-Length: 2, 2\r\n",
        "Content-Length: 2x\r\n", "Content-Length: +2\r\n",
        "Content-Length: 2\r\nContent-Length: 2\r\n"}) {
    HttpConnection connection(port_);
    connection.Send(head + coding + "\r\n" + body);
    EXPECT_THAT(connection.Read().status, AnyOf(0, 400)) << coding;
    EXPECT_EQ(connection.Read().status, 0) << "the rest was answered: " << coding;
  }
  EXPECT_EQ(StatusOf(head + "Transfer-Encoding: Chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n"), 400)
      << "no name in it, but it was read";
}

TEST_F(ServerTest, ZeroBytesEmptyNamesAndFoldedLinesAreRefused) {
  Start();
  const std::string zero(1, '\0'), host = "Host: localhost\r\n", end = "\r\n";
  const auto get = [](const std::string& target) { return "GET " + target + " HTTP/1.1\r\n"; };
  for (const std::string& request :
       {get("/health" + zero) + host + end, get("/health" + zero + "/x") + host + end,
        get("/health?a=b" + zero) + host + end, get("/health?a" + zero + "c=b") + host + end,
        get("/health?a=b" + zero + "&c=d") + host + end, get("/health?" + zero) + host + end,
        get("/health?") + host + end, get("/health") + host + "X-A: a" + zero + "b\r\n" + end,
        get("/health") + "X-A: a" + zero + "b\r\n" + host + end,
        get("/health") + "X-A" + zero + ": b\r\n" + host + end,
        get("/health") + host + "X-A: " + zero + "\r\n" + end,
        get("/health") + host + ": x\r\n" + end, get("/health") + host + "X A: x\r\n" + end,
        get("/health") + host + "X-A: b\r\n c\r\n" + end, get("/health") + host + "X-A: b\n" + end,
        get("/health") + host + "X-A: b\r\n\n", "GET /health HTTP/1.1\n" + host + end,
        "GET  /health HTTP/1.1\r\n" + host + end, "GET /health  HTTP/1.1\r\n" + host + end}) {
    EXPECT_THAT(StatusOf(request), AnyOf(0, 400)) << ::testing::PrintToString(request);
  }
  for (const std::string& request :
       {get("/health") + host + end, get("/health?a") + host + end, get("/health?a=") + host + end,
        get("/health?a=b&c=d") + host + end,
        get("/health") + "X-A:\r\n" + host + "X-B:  b\r\n" + end}) {
    EXPECT_EQ(StatusOf(request), 200) << request;
  }
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
  HttpConnection older(port_);
  older.Send("GET /health HTTP/1.1\r\nHo");
  ExpectAlive();  // what was sent has arrived before this answer
  skipped_s_ = 5;
  HttpConnection slow(port_), known(port_), kept(port_);
  for (HttpConnection* connection : {&known, &kept}) {
    connection->Send("GET /api/v1/session HTTP/1.1\r\nHost: localhost\r\n" +
                     (connection == &known ? "Cookie: " + client.cookie + "\r\n" : "") + "\r\n");
    EXPECT_EQ(connection->Read().status, connection == &known ? 200 : 401);
  }
  for (HttpConnection* connection : {&slow, &known, &kept})
    connection->Send("GET /health HTTP/1.1\r\nHo");
  ExpectAlive();
  skipped_s_ = 11;
  EXPECT_TRUE(older.IsClosedBySoon()) << "the server has looked, after six seconds of the others";
  ExpectAlive();
  for (HttpConnection* connection : {&slow, &known, &kept})
    EXPECT_TRUE(connection->Send("s")) << "that is in time";
  skipped_s_ = 17;
  EXPECT_TRUE(slow.IsClosedBySoon());
  EXPECT_TRUE(kept.IsClosedBySoon()) << "a further request of a stranger";
  EXPECT_TRUE(known.Send("t: localhost\r\n\r\n"));
  EXPECT_EQ(known.Read().status, 200);
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

}  // namespace
}  // namespace plumb::test
