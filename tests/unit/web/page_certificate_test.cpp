// SPDX-License-Identifier: Apache-2.0
// Replacing the page's certificate: who may, what is refused, what is logged, and what a browser
// that connects afterwards is shown. openssl is the browser and makes the certificates.
#include <gmock/gmock.h>

#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <optional>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/self_signed.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/web/web_fixture.hpp"
#include "web/security/certificate_care.hpp"

namespace plumb::test {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

struct Certificate {
  std::string chain, key, fingerprint;
};

class PageCertificateTest : public WebTest {
 protected:
  explicit PageCertificateTest(web::TlsIdentity own = web::MakeTlsIdentity({}))
      : own_(std::move(own)) {}
  virtual void Set(web::HttpServerOptions& /*options*/) {}
  void SetUp() override {
    Start([this](web::HttpServerOptions& options) {
      options.tls = own_;
      options.keep_certificate = [this](const web::TlsIdentity& identity) {
        if (is_full_) throw IoError("no space left on the disk");
        kept_ = identity;
      };
      options.metrics_token = kToken;
      options.wall_now = [this] {
        ++num_looks_;
        num_looks_.notify_all();
        return std::chrono::system_clock::now() +
               std::chrono::seconds(skipped_s_ + clock_off_s_.load());
      };
      options.is_clock_trusted = [this] { return is_clock_trusted_.load(); };
      Set(options);
    });
    const json body = {{"code", setup_code_}, {"name", "engineer"}, {"password", kPassword}};
    const std::string answer = Ask("POST", "/api/v1/setup", body);
    const auto begin = answer.find("__Host-plumb_session=");
    ASSERT_NE(begin, std::string::npos) << answer;
    session_ = answer.substr(begin, answer.find(';', begin) - begin);
    token_ = JsonOf(Ask("GET", "/api/v1/session")).value("csrf_token", "");
    ASSERT_NE(token_, "");
  }

  std::string Run(const std::string& command, const char* written) {
    EXPECT_EQ(
        std::system(
            fmt::format("cd {} && ({}) 2> /dev/null", folder_.path().string(), command).c_str()),
        0)
        << command;
    return Read(written);
  }
  [[nodiscard]] std::string Read(const char* name) const {
    std::ifstream in(folder_ / name);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// The answer's text; each request on a separate connection.
  std::string Ask(const std::string& method, const std::string& path, const json& body = {}) {
    const std::string text = body.is_null() ? "" : body.dump();
    std::ofstream(folder_ / "request")
        << fmt::format("{} {} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n", method, path)
        << (session_.empty() ? "" : fmt::format("Cookie: {}\r\n", session_))
        << (token_.empty() ? "" : fmt::format("X-CSRF-Token: {}\r\n", token_))
        << (text.empty() ? ""
                         : fmt::format("Content-Type: application/json\r\nOrigin: "
                                       "https://localhost\r\nContent-Length: {}\r\n",
                                       text.size()))
        << "\r\n"
        << text;
    return Run(fmt::format("timeout 60 openssl s_client -quiet -connect 127.0.0.1:{} < request > "
                           "answer",
                           port_),
               "answer");
  }
  static json JsonOf(const std::string& answer) {
    return json::parse(answer.substr(answer.find("\r\n\r\n") + 4), nullptr, false);
  }
  /// Of what a new connection is shown.
  std::string Shown() {
    return FingerprintIn(Run(fmt::format("timeout 60 openssl s_client -connect 127.0.0.1:{} < "
                                         "/dev/null | openssl x509 -noout -sha256 -fingerprint > "
                                         "shown",
                                         port_),
                             "shown"));
  }
  static std::string FingerprintIn(const std::string& text) {
    return text.substr(text.find('=') + 1, 95);
  }
  Certificate Made(const std::string& key, const std::string& options = "") {
    Certificate made;
    plumb::testing::MakeSelfSigned(folder_ / "certificate.pem", folder_ / "key.pem", "room 1",
                                   {.days = 20, .key_options = key, .options = options});
    made.chain = Read("certificate.pem");
    made.key = Read("key.pem");
    made.fingerprint = FingerprintIn(
        Run("openssl x509 -noout -sha256 -fingerprint -in certificate.pem > print", "print"));
    return made;
  }
  std::string Put(const std::string& chain, const std::string& key,
                  const std::string& password = kPassword) {
    return Ask("PUT", "/api/v1/certificate",
               {{"certificate", chain}, {"key", key}, {"password", password}});
  }
  void ExpectNothingChanged() {
    EXPECT_TRUE(!kept_ || kept_->fingerprint == own_.fingerprint);
    EXPECT_EQ(Shown(), own_.fingerprint);
    EXPECT_THAT(Ask("GET", "/api/v1/audit"), Not(HasSubstr("\"certificate.")));
  }

  plumb::testing::TempFolder folder_;
  const web::TlsIdentity own_;
  std::optional<web::TlsIdentity> kept_;
  bool is_full_ = false;
  std::string session_, token_;

  // --- its end
  static constexpr const char* kToken = "a-token-of-more-than-thirty-two-letters";
  std::atomic<long> clock_off_s_ = 0;  ///< The wall clock against the steady one.
  std::atomic<bool> is_clock_trusted_ = true;

  /// Sets both clocks to so many seconds before the end of what is served.
  void SkipToBeforeEnd(long left_s, const web::TlsIdentity& served) {
    skipped_s_ = 0;
    clock_off_s_ = 0;
    skipped_s_ = static_cast<int>(web::FactsOfCertificate(served.certificate_pem).valid_until -
                                  std::time(nullptr) - left_s);
  }
  long MaxAge() {
    const std::string answer = Ask("GET", "/health"), name = "Strict-Transport-Security: max-age=";
    const auto at = answer.find(name);
    return at == std::string::npos ? -1 : std::stol(answer.substr(at + name.size()));
  }
  long LeftInMetrics() {
    std::ofstream(folder_ / "request")
        << "GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nAuthorization: "
           "Bearer "
        << kToken << "\r\n\r\n";
    const std::string answer = Run(
        fmt::format("timeout 60 openssl s_client -quiet -connect 127.0.0.1:{} < request > answer",
                    port_),
        "answer");
    const std::string name = "\nplumb_certificate_left_seconds ";
    const auto at = answer.find(name);
    return at == std::string::npos ? 0 : std::stol(answer.substr(at + name.size()));
  }
  /// Waits until the server has looked at the clock twice more: at the second look it has done what
  /// followed the first.
  void LetItCare() {
    const int before = num_looks_;
    for (int seen = before; seen < before + 2; seen = num_looks_) num_looks_.wait(seen);
  }
  std::atomic<int> num_looks_ = 0;
};

/// One that a person set is served until its end and afterwards: nobody is locked out by a browser
/// that remembers to insist on TLS.
TEST_F(PageCertificateTest, BrowsersInsistOnTlsNoLongerThanTheCertificateIsValid) {
  EXPECT_EQ(MaxAge(), 365 * 24 * 3600) << "the unit's own is valid for longer";
  const Certificate made = Made("rsa:2048");  // for 20 days
  ASSERT_THAT(Put(made.chain, made.key), HasSubstr("HTTP/1.1 200"));
  ASSERT_THAT(Ask("GET", "/api/v1/session"), HasSubstr("HTTP/1.1 200"));
  EXPECT_NEAR(static_cast<double>(MaxAge()), 20 * 24 * 3600, 120);
  EXPECT_NEAR(static_cast<double>(LeftInMetrics()), 20 * 24 * 3600, 120);
  SkipToBeforeEnd(1000, *kept_);
  EXPECT_NEAR(static_cast<double>(MaxAge()), 1000, 60);
  SkipToBeforeEnd(-1000, *kept_);
  EXPECT_EQ(MaxAge(), 0);
  EXPECT_NEAR(static_cast<double>(LeftInMetrics()), -1000, 60);
  LetItCare();
  EXPECT_EQ(Shown(), made.fingerprint) << "what a person set is not replaced";
}

/// A clock that leaps past the end makes no certificate of the future, which no browser would take.
TEST_F(PageCertificateTest, ItsOwnIsRenewedOnlyWhenTheClockHasHeldForAnHour) {
  clock_off_s_ = 10L * 365 * 24 * 3600;
  LetItCare();
  EXPECT_EQ(Shown(), own_.fingerprint) << "at once";
  skipped_s_ += 3500;
  LetItCare();
  EXPECT_EQ(Shown(), own_.fingerprint) << "not an hour yet";
  is_clock_trusted_ = false;
  skipped_s_ += 700;
  LetItCare();
  EXPECT_EQ(Shown(), own_.fingerprint) << "as long as the clock is doubted";
  is_clock_trusted_ = true;
  skipped_s_ += 700;
  LetItCare();
  EXPECT_NE(Shown(), own_.fingerprint);
  EXPECT_EQ(Shown(), kept_->fingerprint);
  EXPECT_GT(LeftInMetrics(), 800L * 24 * 3600);
}

/// Of the unit's own authority, which its browsers know.
class IssuedCertificateTest : public PageCertificateTest {
 protected:
  IssuedCertificateTest()
      : PageCertificateTest(
            web::IssueTlsIdentity(Authority(), {}, std::chrono::system_clock::now())) {}
  static const std::string& Authority() {
    static const std::string authority = web::MakeAuthority({});
    return authority;
  }
  void Set(web::HttpServerOptions& options) override {
    options.own_addresses = [this]() -> std::vector<std::string> {
      if (!has_moved_) return {};
      // The one of another interface comes and goes, at times before the one that stays.
      const std::string other = "10.9.0." + std::to_string(++num_looks_ % 200);
      if (num_looks_ % 2 == 0) return {other, "10.20.30.40"};
      return {"2001:db8::1", "10.20.30.40", other};
    };
    options.make_certificate = [](std::chrono::system_clock::time_point now) {
      return web::IssueTlsIdentity(Authority(), {"10.20.30.40"}, now);
    };
  }
  std::atomic<bool> has_moved_ = false;
  std::atomic<int> num_looks_ = 0;
};

TEST_F(IssuedCertificateTest, ItIsRenewedForAnAddressThatTheUnitHasHadForAnHour) {
  LetItCare();
  EXPECT_EQ(Shown(), own_.fingerprint);
  has_moved_ = true;
  skipped_s_ += 660;
  LetItCare();
  skipped_s_ += 3500;
  LetItCare();
  EXPECT_EQ(Shown(), own_.fingerprint) << "not an hour yet";
  skipped_s_ += 660;
  LetItCare();
  ASSERT_NE(Shown(), own_.fingerprint);
  const std::string renewed = Shown();
  skipped_s_ += 2 * 3600;
  LetItCare();
  EXPECT_EQ(Shown(), renewed)
      << "it names the address of IPv4, and that of IPv6 alone renews nothing";
}

TEST_F(PageCertificateTest, ANewConnectionIsShownTheNewOneAndTheLogHasBothFingerprints) {
  ASSERT_EQ(Shown(), own_.fingerprint);
  for (const char* key : {"rsa:2048", "ec -pkeyopt ec_paramgen_curve:P-256"}) {
    const std::string before = Shown();
    const Certificate made = Made(key);
    EXPECT_THAT(Put(made.chain, made.key), HasSubstr("HTTP/1.1 200"));
    EXPECT_EQ(Shown(), made.fingerprint);
    ASSERT_TRUE(kept_);
    EXPECT_EQ(kept_->fingerprint, before) << "until a browser has come back";
    EXPECT_THAT(Ask("GET", "/api/v1/session"), HasSubstr("HTTP/1.1 200"));
    EXPECT_EQ(kept_->key_pem, made.key);
    EXPECT_EQ(kept_->fingerprint, made.fingerprint);
    const std::string certificate = Ask("GET", "/api/v1/certificate");
    EXPECT_EQ(JsonOf(certificate)["fingerprint"], made.fingerprint);
    EXPECT_EQ(JsonOf(certificate)["subject"], "CN=room 1");
    EXPECT_EQ(JsonOf(certificate)["replaceable"], true);
    const std::string log = Ask("GET", "/api/v1/audit");
    EXPECT_THAT(log, HasSubstr("certificate.replace"));
    EXPECT_THAT(log, HasSubstr(before + " -> " + made.fingerprint));
    EXPECT_THAT(certificate + log, Not(HasSubstr("PRIVATE"))) << "the key never comes back";
  }
}

/// A clock that counts nanoseconds ends in the year 2262.
TEST_F(PageCertificateTest, TheEndOfOneThatIsValidForCenturiesIsShownAsItIs) {
  const Certificate made = Made("ec -pkeyopt ec_paramgen_curve:P-256", "-days 146097");
  ASSERT_THAT(Put(made.chain, made.key), HasSubstr("HTTP/1.1 200"));
  const std::string end =
      Run("openssl x509 -noout -enddate -dateopt iso_8601 -in certificate.pem > end", "end");
  EXPECT_THAT(end, HasSubstr("notAfter=24"));  // 146097 days are 400 years
  const std::string shown = JsonOf(Ask("GET", "/api/v1/certificate")).value("valid_until", "");
  EXPECT_EQ(shown.substr(0, 10), end.substr(end.find('=') + 1, 10));
}

TEST_F(PageCertificateTest, ASelfMadeOneIsNewEachTime) {
  EXPECT_THAT(Ask("POST", "/api/v1/certificate/new", {{"password", "another password"}}),
              HasSubstr("HTTP/1.1 403"));
  ExpectNothingChanged();
  EXPECT_THAT(Ask("POST", "/api/v1/certificate/new", {{"password", kPassword}}),
              HasSubstr("HTTP/1.1 200"));
  ASSERT_TRUE(kept_);
  EXPECT_NE(kept_->fingerprint, own_.fingerprint);
  EXPECT_EQ(Shown(), kept_->fingerprint);
  EXPECT_THAT(Ask("GET", "/api/v1/audit"),
              HasSubstr(own_.fingerprint + " -> " + kept_->fingerprint));
}

TEST_F(PageCertificateTest, OneThatNoBrowserComesBackWithIsTakenBackAfterTwoMinutes) {
  const Certificate made = Made("rsa:2048");
  ASSERT_THAT(Put(made.chain, made.key), HasSubstr("\"trial_s\":120"));
  skipped_s_ = 115;
  EXPECT_EQ(Shown(), made.fingerprint) << "a handshake is no browser that came back";
  EXPECT_EQ(kept_->fingerprint, own_.fingerprint) << "a restart would end the trial, too";
  skipped_s_ = 121;
  for (int i = 0; i < 20 && Shown() != own_.fingerprint; ++i) sleep(1);
  EXPECT_EQ(Shown(), own_.fingerprint);
  EXPECT_EQ(kept_->fingerprint, own_.fingerprint);
  EXPECT_THAT(Ask("GET", "/api/v1/audit"), HasSubstr("certificate.revert"));
}

TEST_F(PageCertificateTest, OneThatABrowserCameBackWithStays) {
  const Certificate made = Made("rsa:2048");
  ASSERT_THAT(Put(made.chain, made.key), HasSubstr("HTTP/1.1 200"));
  EXPECT_EQ(JsonOf(Ask("GET", "/api/v1/certificate"))["on_trial"], false);
  skipped_s_ = 200;
  sleep(7);
  EXPECT_EQ(Shown(), made.fingerprint);
  EXPECT_EQ(kept_->fingerprint, made.fingerprint);
  EXPECT_THAT(Ask("GET", "/api/v1/audit"), Not(HasSubstr("certificate.revert")));
}

TEST_F(PageCertificateTest, KindsThatBrowsersDoNotOpenAreRefusedWithTheCause) {
  for (const char* key : {"ed25519", "ec -pkeyopt ec_paramgen_curve:P-521",
                          "ec -pkeyopt ec_paramgen_curve:secp256k1"}) {
    const Certificate made = Made(key);
    EXPECT_THAT(Put(made.chain, made.key), HasSubstr("HTTP/1.1 400")) << key;
  }
  const Certificate other = Made("ed25519"), page = Made("ec -pkeyopt ec_paramgen_curve:P-384");
  EXPECT_THAT(Put(other.chain, other.key), HasSubstr("browsers do not open"));
  EXPECT_THAT(Put(page.chain + other.chain, page.key), HasSubstr("browsers do not open"))
      << "an authority in the chain";
  ExpectNothingChanged();
  EXPECT_THAT(Put(page.chain, page.key), HasSubstr("HTTP/1.1 200"));
}

TEST_F(PageCertificateTest, AWrongPasswordChangesNothing) {
  const Certificate made = Made("rsa:2048");
  EXPECT_THAT(Put(made.chain, made.key, "another password"), HasSubstr("HTTP/1.1 403"));
  ExpectNothingChanged();
}

TEST_F(PageCertificateTest, WhatCannotBeServedIsRefusedWithTheReason) {
  const Certificate made = Made("rsa:2048");
  const auto expect_refused = [this](const std::string& answer, const char* why) {
    EXPECT_THAT(answer, HasSubstr("HTTP/1.1 400")) << why;
    EXPECT_THAT(answer, HasSubstr(why));
  };
  expect_refused(Put(made.chain, own_.key_pem), "not that of the certificate");
  expect_refused(Put(made.chain, "no key"), "holds no key");
  expect_refused(Put("garbage", made.key), "holds no certificate");
  expect_refused(Put(made.key, made.key), "holds no certificate");
  expect_refused(Put("", made.key), "certificate must have 1 to 32768 bytes");
  expect_refused(Put(std::string(32769, 'A'), made.key), "certificate must have 1 to 32768 bytes");
  expect_refused(Put(std::string(32768, 'A'), made.key), "holds no certificate");
  expect_refused(Put(made.chain, std::string(16385, 'A')), "key must have 1 to 16384 bytes");
  const Certificate weak = Made("rsa:1024");
  expect_refused(Put(weak.chain, weak.key), "1024 bits");
  expect_refused(Put(made.chain + weak.chain, made.key), "1024 bits");
  ExpectNothingChanged();
}

TEST_F(PageCertificateTest, AFullDiskIsToldAndTheOneBeforeStays) {
  is_full_ = true;
  const Certificate made = Made("rsa:2048");
  const std::string answer = Put(made.chain, made.key);
  EXPECT_THAT(answer, HasSubstr("HTTP/1.1 500"));
  EXPECT_THAT(answer, HasSubstr("no space left on the disk"));
  ExpectNothingChanged();
}

/// Without TLS, or where the configuration names the certificate.
class FixedCertificateTest : public WebTest {};

TEST_F(FixedCertificateTest, ItIsRefusedAndSaysWhy) {
  Start();
  SetUpAccounts();
  HttpClient engineer = LoggedIn("engineer");
  EXPECT_EQ(engineer.Get("/api/v1/certificate").json()["replaceable"], false);
  const HttpAnswer answer = engineer.Post("/api/v1/certificate/new", {{"password", kPassword}});
  EXPECT_EQ(answer.status, 409);
  EXPECT_THAT(answer.body, HasSubstr("web.tls_certificate"));
  for (const char* name : {"technician", "physicist"}) {
    HttpClient other = LoggedIn(name);
    EXPECT_EQ(other.Post("/api/v1/certificate/new", {{"password", kPassword}}).status, 403) << name;
    EXPECT_EQ(other.Put("/api/v1/certificate", json::object()).status, 403) << name;
    EXPECT_EQ(other.Get("/api/v1/certificate").status, 403) << name;
  }
}

TEST(UsableTlsIdentityTest, IsOnlyOneThatIsValidNow) {
  const std::time_t made = 1'800'000'000, begin = made - 86'400;
  const web::TlsIdentity own =
      web::MakeTlsIdentity({}, std::chrono::system_clock::from_time_t(made));
  const auto at = [&](std::time_t time) {
    return web::UsableTlsIdentity(own.certificate_pem, own.key_pem,
                                  std::chrono::system_clock::from_time_t(time))
        .fingerprint;
  };
  const std::time_t end = web::FactsOfCertificate(own.certificate_pem).valid_until;
  using plumb::testing::MessageOf;
  EXPECT_THAT(MessageOf<DataError>([&] { (void)at(begin - 1); }), HasSubstr("valid only from"));
  EXPECT_EQ(at(begin), own.fingerprint);
  EXPECT_EQ(at(end - 1), own.fingerprint);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)at(end); }), HasSubstr("ended on"));
}

}  // namespace
}  // namespace plumb::test
