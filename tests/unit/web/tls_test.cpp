// SPDX-License-Identifier: Apache-2.0
// The server over TLS, and what is a certificate with its key.
#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/self_signed.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/server_fixture.hpp"
#include "words/web.hpp"

namespace plumb::test {
namespace {

using ::testing::HasSubstr;

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
    plumb::testing::MakeSelfSigned(folder_ / "cert", folder_ / "key", "x");
    const std::string script =
        "cd " + folder_.path().string() +
        " && rm -f server && { timeout 60 openssl s_server -accept 127.0.0.1:0 -cert cert -key key "
        "-www " +
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
    return plumb::testing::MessageOf<DataError>([&] {
      (void)web::CheckedTlsIdentity(certificate, key, say::web::FileNamed("/etc/cert.pem"));
    });
  };
  EXPECT_THAT(complaint("-----BEGIN NONSENSE-----\n", one.key_pem), HasSubstr("/etc/cert.pem"));
  EXPECT_THAT(complaint("", one.key_pem), HasSubstr("no certificate"));
  EXPECT_THAT(complaint(one.certificate_pem, ""), HasSubstr("no key"));
  EXPECT_THAT(complaint(one.certificate_pem, other.key_pem), HasSubstr("not that of"));
  const std::string both = one.certificate_pem + one.key_pem;
  EXPECT_EQ(web::CheckedTlsIdentity(both, both, {}).fingerprint, one.fingerprint);
  EXPECT_NE(one.fingerprint, other.fingerprint);
}

}  // namespace
}  // namespace plumb::test
