// SPDX-License-Identifier: Apache-2.0
// Certificate and keys of the page: made once, kept from others, never overwritten.
#include "daemon/unit/page_identity.hpp"

#include <sys/stat.h>

#include <unistd.h>

#include <fstream>
#include <iterator>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/http/listen_socket.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::MessageOf;

class PageIdentityTest : public ::testing::Test {
 protected:
  PageIdentityTest() { config_.appliance.state = folder_.path(); }

  [[nodiscard]] PageNotes Identify(const std::string& address) {
    options_ = {};
    options_.address = address;
    return IdentifyPage(config_, options_);
  }
  [[nodiscard]] std::string Text(const char* name) const {
    std::ifstream in(folder_ / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  testing::TempFolder folder_;
  Config config_;
  web::HttpServerOptions options_;
};

TEST_F(PageIdentityTest, WhereThePageCannotBeServedItIsElsewhereAndSaysWhy) {
  WebConfig web;
  web.listen = "127.0.0.1:0";
  const PageSocket first = OpenPageSocket(web, "127.0.0.1:0");
  EXPECT_EQ(first.fault.English() + first.warning.English(), "");
  const std::string taken = fmt::format("127.0.0.1:{}", web::PortOf(first.fd));
  web.listen = taken;
  const PageSocket second = OpenPageSocket(web, "127.0.0.2:0");
  EXPECT_THAT(second.fault.English(), HasSubstr("web.listen: cannot listen on 127.0.0.1 port"));
  EXPECT_THAT(second.fault.English(), HasSubstr("Address already in use"));
  EXPECT_EQ(web.listen, "127.0.0.2:0");
  EXPECT_EQ(web::AddressTextOf(second.fd), "127.0.0.2");
  web.listen = taken;
  EXPECT_THROW((void)OpenPageSocket(web, taken), IoError) << "nothing is left";
  web.listen = "192.0.2.7:0";  // of no machine: RFC 5737
  const PageSocket early = OpenPageSocket(web, "127.0.0.1:0");
  EXPECT_EQ(early.fault.English(), "") << "a network that comes up later is no mistake";
  EXPECT_THAT(early.warning.English(), HasSubstr("192.0.2.7 is no address of this machine now"));
  for (const int fd : {first.fd, second.fd, early.fd}) ::close(fd);
}

TEST_F(PageIdentityTest, OnLoopbackThereIsNoTlsAndOffItACertificateThatStays) {
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1"}) {
    const PageNotes notes = Identify(address);
    EXPECT_FALSE(options_.tls) << address;
    EXPECT_EQ(notes.certificate, "");
    EXPECT_THAT(EnglishTexts(notes.warnings), IsEmpty());
  }
  EXPECT_EQ(Identify("127.0.0.1").url, "http://127.0.0.1");
  EXPECT_FALSE(fs::exists(folder_ / "page-key.pem"));
  std::string certificate;
  for (const char* address : {"0.0.0.0", "10.1.2.3", "::", "fe80::1"}) {
    const PageNotes notes = Identify(address);
    ASSERT_TRUE(options_.tls) << address;
    if (certificate.empty()) certificate = notes.certificate;
    EXPECT_EQ(notes.certificate, certificate) << address;
    EXPECT_THAT(EnglishTexts(notes.warnings), IsEmpty());
  }
  EXPECT_EQ(Identify("::").url, "https://[::]");
  EXPECT_EQ(certificate.size(), 95U);
}

TEST_F(PageIdentityTest, SecretsAreForTheOwnerAlone) {
  ::umask(0);
  (void)Identify("0.0.0.0");
  const std::string device_key = options_.device_key;
  EXPECT_EQ(device_key.size(), 32U);
  for (const char* name : {"page-key.pem", "page-authority.pem", "device.key"}) {
    EXPECT_EQ(fs::status(folder_ / name).permissions(), fs::perms(0600)) << name;
    fs::permissions(folder_ / name, fs::perms(0644));
  }
  (void)Identify("0.0.0.0");
  (void)options_.make_certificate(std::chrono::system_clock::now());
  for (const char* name : {"page-key.pem", "page-authority.pem", "device.key"})
    EXPECT_EQ(fs::status(folder_ / name).permissions(), fs::perms(0600)) << name << ", again";
  EXPECT_EQ(options_.device_key, device_key) << "browsers stay known";
  ::umask(022);
}

TEST_F(PageIdentityTest, RenewalsComeFromTheSameAuthorityUntilTheUnitHasAnotherName) {
  (void)Identify("0.0.0.0");
  const auto first = web::OwnAuthorityOf(options_.tls.value().certificate_pem);
  ASSERT_TRUE(first);
  const auto now = std::chrono::system_clock::now();
  const auto authority_of = [&](std::chrono::system_clock::time_point when) {
    return web::OwnAuthorityOf(options_.make_certificate(when).certificate_pem)
        .value_or(web::AuthorityCertificate{})
        .fingerprint;
  };
  EXPECT_EQ(authority_of(now), first->fingerprint);
  EXPECT_EQ(authority_of(now + std::chrono::hours(24 * 3000)), first->fingerprint);
  (void)Identify("0.0.0.0");
  EXPECT_EQ(authority_of(now), first->fingerprint) << "after a restart";
  config_.web.host_names = {"renamed.clinic.example"};
  (void)Identify("0.0.0.0");
  EXPECT_NE(authority_of(now), first->fingerprint) << "it may not sign that name";
  EXPECT_EQ(authority_of(now), authority_of(now)) << "the new one stays";
}

TEST_F(PageIdentityTest, ASelfSignedOneOfBeforeStaysUntilItIsRenewed) {
  const web::TlsIdentity before = web::MakeTlsIdentity({});
  KeepPageIdentity(folder_.path(), before);
  EXPECT_EQ(Identify("0.0.0.0").certificate, before.fingerprint);
  EXPECT_FALSE(fs::exists(folder_ / "page-authority.pem")) << "nothing to install yet";
  const web::TlsIdentity next = options_.make_certificate(std::chrono::system_clock::now());
  EXPECT_TRUE(web::OwnAuthorityOf(next.certificate_pem));
}

TEST_F(PageIdentityTest, WhatCannotBeUsedStaysAsItIsAndIsTold) {
  std::ofstream(folder_ / "page-key.pem") << "half a certificate";
  std::ofstream(folder_ / "device.key") << "short";
  const PageNotes notes = Identify("0.0.0.0");
  ASSERT_TRUE(options_.tls) << "one for this run";
  EXPECT_THAT(EnglishTexts(notes.warnings),
              ElementsAre(HasSubstr("page-key.pem"), HasSubstr("device.key")));
  EXPECT_EQ(Text("page-key.pem"), "half a certificate");
  EXPECT_EQ(Text("device.key"), "short");
  EXPECT_EQ(options_.device_key, "");
}

TEST_F(PageIdentityTest, ALinkInPlaceOfASecretIsNotFollowed) {
  std::ofstream(folder_ / "elsewhere") << std::string(32, 'x');
  fs::create_symlink(folder_ / "elsewhere", folder_ / "device.key");
  EXPECT_THAT(EnglishTexts(Identify("127.0.0.1").warnings),
              ElementsAre(HasSubstr("not a regular file")));
  EXPECT_EQ(options_.device_key, "");
}

TEST_F(PageIdentityTest, WhereNothingCanBeWrittenItIsForThisRunOnly) {
  config_.appliance.state = "/proc/nowhere";
  const PageNotes notes = Identify("0.0.0.0");
  EXPECT_TRUE(options_.tls);
  EXPECT_THAT(EnglishTexts(notes.warnings),
              ElementsAre(HasSubstr("for this run only"), HasSubstr("not known again")));
}

TEST_F(PageIdentityTest, TheTokenOfMetricsIsASecretOrRefused) {
  EXPECT_TRUE(AccessToken(config_.web.metrics_token_file).empty());
  config_.web.metrics_token_file = folder_ / "token";
  const auto token_of = [&](const std::string& text) {
    std::ofstream(folder_ / "token") << text;
    return AccessToken(config_.web.metrics_token_file);
  };
  const std::string shortest(32, 'a');
  EXPECT_EQ(token_of(shortest + "\n"), shortest);
  EXPECT_EQ(token_of(std::string(256, '_')).size(), 256U);
  for (const std::string& bad : {shortest.substr(1), std::string(257, 'a'), shortest + " x",
                                 shortest + "\n" + shortest, std::string("\n")}) {
    EXPECT_THAT(MessageOf<DataError>([&] { (void)token_of(bad); }), HasSubstr("32 to 256"));
    EXPECT_THROW(CheckPageIdentity(config_.web), DataError);
  }
  fs::remove(folder_ / "token");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)AccessToken(config_.web.metrics_token_file); }),
              HasSubstr("token"));
}

TEST_F(PageIdentityTest, TheConfigurationsCertificateIsUsedOrRefusedByName) {
  const web::TlsIdentity given = web::MakeTlsIdentity({}), other = web::MakeTlsIdentity({});
  std::ofstream(folder_ / "cert.pem") << given.certificate_pem;
  std::ofstream(folder_ / "key.pem") << given.key_pem;
  config_.web.tls_certificate = folder_ / "cert.pem";
  config_.web.tls_key = folder_ / "key.pem";
  EXPECT_EQ(Identify("127.0.0.1").certificate, given.fingerprint);
  EXPECT_FALSE(fs::exists(folder_ / "page-key.pem"));
  EXPECT_NO_THROW(CheckPageIdentity(config_.web));
  std::ofstream(folder_ / "key.pem") << other.key_pem;
  EXPECT_THROW(CheckPageIdentity(config_.web), DataError);
  EXPECT_THAT(MessageOf<DataError>([&] { (void)Identify("0.0.0.0"); }), HasSubstr("key.pem"));
  fs::remove(folder_ / "cert.pem");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)Identify("0.0.0.0"); }), HasSubstr("cert.pem"));
}

TEST_F(PageIdentityTest, WhatReplacesItIsServedAtTheNextStartForTheOwnerAlone) {
  const std::string own = Identify("0.0.0.0").certificate;
  ASSERT_TRUE(options_.keep_certificate);
  const web::TlsIdentity other = web::MakeTlsIdentity({});
  options_.keep_certificate(other);
  EXPECT_EQ(fs::status(folder_ / "page-key.pem").permissions(), fs::perms(0600));
  EXPECT_NE(own, other.fingerprint);
  EXPECT_EQ(Identify("0.0.0.0").certificate, other.fingerprint);
  EXPECT_NE(options_.tls->key_pem.find(other.key_pem), std::string::npos);
}

TEST_F(PageIdentityTest, WhereTheDiskRefusesTheOneBeforeStays) {
  const std::string own = Identify("0.0.0.0").certificate;
  fs::create_directory(folder_ / ".page-key.pem.new");  // in the way of what is written
  EXPECT_THROW(options_.keep_certificate(web::MakeTlsIdentity({})), IoError);
  EXPECT_EQ(Identify("0.0.0.0").certificate, own);
}

TEST_F(PageIdentityTest, PlainHttpOffLoopbackWarns) {
  config_.web.plain_http = true;
  EXPECT_THAT(EnglishTexts(Identify("0.0.0.0").warnings), ElementsAre(HasSubstr("without TLS")));
  EXPECT_FALSE(options_.tls);
  EXPECT_THAT(EnglishTexts(Identify("127.0.0.1").warnings), IsEmpty());
}

}  // namespace
}  // namespace plumb
