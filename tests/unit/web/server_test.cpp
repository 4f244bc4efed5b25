// What a hostile or clumsy client sends, on the wire.
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cstdlib>
#include <fstream>

#include "algo/base/errors.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"

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

TEST_F(ServerTest, AThousandIdleConnectionsDoNotShutOutOthers) {
  Start();
  rlimit files{};
  getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = std::min<rlim_t>(files.rlim_max, 8192);
  setrlimit(RLIMIT_NOFILE, &files);
  std::vector<HttpConnection> idle;
  for (int i = 0; i < 1000; ++i) idle.emplace_back(port_);
  HttpConnection other(port_, "127.0.0.2");
  other.Send("GET /health HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_EQ(other.Read().status, 200);
  idle.clear();
  ExpectAlive();
}

TEST_F(ServerTest, AnAddressInUseIsSaid) {
  Start();
  web::HttpServerOptions options;
  options.port = port_;
  try {
    const web::HttpServer second(service_, options);
    FAIL() << "two servers on one port";
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr(std::to_string(port_)));
  }
  options.port = 0;
  options.address = "not an address";
  EXPECT_THROW(web::HttpServer(service_, options), IoError);
}

TEST_F(ServerTest, MissingOrWrongCertificatesAreSaid) {
  const plumb::testing::TempFolder folder;
  web::HttpServerOptions options;
  options.tls_certificate = folder / "cert.pem";
  options.tls_key = folder / "key.pem";
  EXPECT_THROW(web::HttpServer(service_, options), DataError);
  for (const char* name : {"cert.pem", "key.pem"})
    std::ofstream(folder / name) << "-----BEGIN NONSENSE-----\n";
  EXPECT_THROW(web::HttpServer(service_, options), IoError);
}

/// A certificate for this test alone, and what a TLS client makes of the server.
TEST_F(ServerTest, ServesTlsWithASecureCookie) {
  if (std::system("openssl version > /dev/null 2>&1") != 0)
    GTEST_SKIP() << "no openssl (Debian package openssl)";
  const plumb::testing::TempFolder folder;
  const std::string certificate = (folder / "cert.pem").string(),
                    key = (folder / "key.pem").string();
  ASSERT_EQ(std::system(("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 "
                         "-nodes -days 2 -subj /CN=localhost -keyout " +
                         key + " -out " + certificate + " 2> /dev/null")
                            .c_str()),
            0);
  Start([&](web::HttpServerOptions& options) {
    options.tls_certificate = certificate;
    options.tls_key = key;
  });
  const std::string body =
      nlohmann::json{{"code", setup_code_}, {"name", "eve"}, {"password", kPassword}}.dump();
  std::ofstream(folder / "request")
      << "POST /api/v1/setup HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: "
         "application/json\r\n"
      << "Origin: https://localhost\r\nContent-Length: " << body.size() << "\r\n\r\n"
      << body;
  const std::string answer_file = (folder / "answer").string();
  ASSERT_EQ(std::system(("timeout 60 openssl s_client -quiet -verify_return_error -CAfile " +
                         certificate + " -connect 127.0.0.1:" + std::to_string(port_) + " < " +
                         (folder / "request").string() + " > " + answer_file + " 2> /dev/null")
                            .c_str()),
            0);
  std::ifstream in(answer_file);
  const std::string answer((std::istreambuf_iterator<char>(in)), {});
  EXPECT_THAT(answer, HasSubstr("HTTP/1.1 200"));
  EXPECT_THAT(answer, HasSubstr("__Host-plumb_session="));
  EXPECT_THAT(answer, HasSubstr("; Secure"));
  EXPECT_EQ(StatusOf("GET /health HTTP/1.1\r\nHost: localhost\r\n\r\n"), 0)
      << "no answer without TLS";
}

}  // namespace
}  // namespace plumb::test
