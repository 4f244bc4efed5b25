// SPDX-License-Identifier: Apache-2.0
// What is reported about a certificate, on both sides of each limit; openssl makes them.
#include "web/security/certificate_care.hpp"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <memory>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/security/tls_identity.hpp"

namespace plumb::web {
namespace {

using std::chrono::system_clock;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class CertificateCareTest : public ::testing::Test {
 protected:
  std::string Run(const std::string& arguments, const std::string& written) {
    const std::string command =
        fmt::format("cd {} && openssl {} 2>/dev/null", folder_.path().string(), arguments);
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    std::ifstream in(folder_ / written);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  /// Of `days` from now, for a key as `openssl req -newkey` names it.
  std::string Made(const std::string& key, int days, const std::string& name = "room 1") {
    return Run(fmt::format("req -x509 -newkey {} -nodes -days {} -subj '/CN={}' -keyout key.pem "
                           "-out certificate.pem",
                           key, days, name),
               "certificate.pem");
  }

  // Later than what the tests make: certificates begin with the second in which they are made.
  const system_clock::time_point begin_ = system_clock::now(),
                                 now_ = begin_ + std::chrono::minutes(1);
  testing::TempFolder folder_;
};

constexpr const char* kCurve = "ec -pkeyopt ec_paramgen_curve:P-256";

TEST_F(CertificateCareTest, ItsEndIsToldFromThirtyDaysBefore) {
  const std::string pem = Made(kCurve, 100);
  const std::chrono::hours day(24);
  const std::chrono::minutes late(1);
  EXPECT_THAT(EnglishTexts(CertificateWarnings(pem, now_)), IsEmpty());
  EXPECT_THAT(EnglishTexts(CertificateWarnings(pem, begin_ + 70 * day - late)), IsEmpty());
  EXPECT_THAT(EnglishTexts(CertificateWarnings(pem, begin_ + 70 * day + late)),
              ElementsAre(AllOf(HasSubstr("CN=room 1"), HasSubstr(" ends on "))));
  EXPECT_THAT(EnglishTexts(CertificateWarnings(pem, begin_ + 100 * day - late)),
              ElementsAre(HasSubstr(" ends on ")));
  EXPECT_THAT(EnglishTexts(CertificateWarnings(pem, begin_ + 100 * day + late)),
              ElementsAre(HasSubstr(" ended on ")));
  EXPECT_THAT(EnglishTexts(CertificateWarnings(pem, begin_ - late)),
              ElementsAre(HasSubstr("valid only from")));
}

TEST_F(CertificateCareTest, TheEndOfEachOfAChainIsTold) {
  const std::string first = Made(kCurve, 100, "the page"), second = Made(kCurve, 20, "authority");
  EXPECT_THAT(EnglishTexts(CertificateWarnings(first + second, now_)),
              ElementsAre(AllOf(HasSubstr("CN=authority"), HasSubstr(" ends on "))));
}

TEST_F(CertificateCareTest, AWeakKeyIsTold) {
  EXPECT_THAT(EnglishTexts(CertificateWarnings(Made("rsa:1024", 100), now_)),
              ElementsAre(AllOf(HasSubstr("too weak"), HasSubstr("1024 bits"))));
  EXPECT_THAT(EnglishTexts(CertificateWarnings(Made("rsa:2047", 100), now_)),
              ElementsAre(HasSubstr("2047 bits")));
  EXPECT_THAT(EnglishTexts(CertificateWarnings(Made("rsa:2048", 100), now_)), IsEmpty());
  EXPECT_THAT(
      EnglishTexts(CertificateWarnings(Made("ec -pkeyopt ec_paramgen_curve:P-192", 100), now_)),
      ElementsAre(HasSubstr("192 bits")));
  const std::string authority = Made("rsa:1024", 100, "authority");
  EXPECT_THAT(EnglishTexts(CertificateWarnings(Made("rsa:2048", 100) + authority, now_)),
              ElementsAre(AllOf(HasSubstr("CN=authority"), HasSubstr("1024 bits"))));
}

TEST_F(CertificateCareTest, AKindOfKeyThatBrowsersDoNotOpenIsTold) {
  for (const char* kind : {"ed25519", "ec -pkeyopt ec_paramgen_curve:P-521"})
    EXPECT_THAT(EnglishTexts(CertificateWarnings(Made(kind, 100), now_)),
                ElementsAre(HasSubstr("browsers do not open")))
        << kind;
  for (const char* kind : {"rsa:3072", "ec -pkeyopt ec_paramgen_curve:P-384"})
    EXPECT_THAT(EnglishTexts(CertificateWarnings(Made(kind, 100), now_)), IsEmpty()) << kind;
}

TEST_F(CertificateCareTest, ItsOwnIsRenewedBeforeItsEndAndWhatAPersonSetNever) {
  const std::chrono::hours day(24);
  const std::vector<std::string> names = OwnNames();
  const std::string own = MakeTlsIdentity({}, begin_).certificate_pem;
  EXPECT_FALSE(IsDueForRenewal(own, begin_, names));
  EXPECT_FALSE(IsDueForRenewal(own, begin_ + 758 * day, names));
  EXPECT_TRUE(IsDueForRenewal(own, begin_ + 760 * day, names)) << "before it is warned of";
  EXPECT_TRUE(IsDueForRenewal(own, begin_ - 2 * day, names)) << "made while the clock was wrong";
  EXPECT_TRUE(IsDueForRenewal(own, begin_, {"another-name"})) << "the machine was renamed";
  EXPECT_FALSE(
      IsDueForRenewal(MakeTlsIdentity({"another-name"}).certificate_pem, begin_, {"another-name"}));
  // As 0.2.0 made them: longer than Safari takes.
  EXPECT_TRUE(IsDueForRenewal(Made(kCurve, 31000, "Plumb scan appliance"), begin_, {}));
  EXPECT_FALSE(IsDueForRenewal(Made(kCurve, 31000), begin_ + 30990 * day, {}));
}

TEST_F(CertificateCareTest, ItsOwnIsValidForNoLongerThanBrowsersTake) {
  const TlsIdentity own = MakeTlsIdentity({}, begin_);
  const auto left =
      system_clock::from_time_t(FactsOfCertificate(own.certificate_pem).valid_until) - begin_;
  EXPECT_GT(left, std::chrono::hours(24 * 800));
  EXPECT_LE(left + std::chrono::hours(24), std::chrono::hours(24 * 825));
}

TEST_F(CertificateCareTest, TheAppliancesOwnIsNothingToTellOf) {
  const TlsIdentity own = MakeTlsIdentity({});
  EXPECT_THAT(EnglishTexts(CertificateWarnings(own.certificate_pem, now_)), IsEmpty());
  EXPECT_THAT(EnglishTexts(CertificateWarnings(own.key_pem + own.certificate_pem, now_)),
              IsEmpty());
}

class AuthorityTest : public CertificateCareTest {
 protected:
  /// What openssl says of the identity to somebody who trusts the authority only.
  std::string Verified(const std::string& authority, const TlsIdentity& identity,
                       const std::string& how) {
    std::ofstream(folder_ / "ca.pem") << authority;
    std::ofstream(folder_ / "leaf.pem") << identity.certificate_pem;
    const std::string command =
        fmt::format("cd {} && openssl verify -x509_strict -CAfile ca.pem {} leaf.pem 2>&1",
                    folder_.path().string(), how);
    const std::unique_ptr<FILE, int (*)(FILE*)> out(::popen(command.c_str(), "r"), &::pclose);
    std::array<char, 2000> text{};
    return {text.data(), std::fread(text.data(), 1, text.size(), out.get())};
  }
  const std::vector<std::string> names_ = {"plumb-3.clinic.example", "10.1.2.3"};
};

TEST_F(AuthorityTest, WhoTrustsItTrustsThisUnitAndEachRenewalAndNothingElse) {
  const std::string authority = MakeAuthority(names_, begin_);
  const TlsIdentity first = IssueTlsIdentity(authority, names_, begin_);
  const auto begin = system_clock::to_time_t(begin_);
  const auto at = [&](const std::string& name, int days) {
    return fmt::format("-verify_{} {} -attime {}", name == "10.1.2.3" ? "ip" : "hostname", name,
                       begin + std::time_t{86400} * days);
  };
  for (const char* name : {"plumb-3.clinic.example", "10.1.2.3", "localhost"})
    EXPECT_EQ(Verified(authority, first, at(name, 0)), "leaf.pem: OK\n") << name;
  EXPECT_THAT(Verified(authority, first, at("localhost", 397)), HasSubstr("expired"));
  const TlsIdentity next =
      IssueTlsIdentity(authority, names_, begin_ + std::chrono::hours(24 * 340));
  EXPECT_NE(next.fingerprint, first.fingerprint);
  EXPECT_EQ(Verified(authority, next, at("localhost", 397)), "leaf.pem: OK\n");
  // By another authority, or for a site that is not this unit's.
  EXPECT_THAT(Verified(MakeAuthority(names_, begin_), first, at("localhost", 0)),
              HasSubstr("verification failed"));
  const TlsIdentity stolen = IssueTlsIdentity(authority, {"bank.example"}, begin_);
  EXPECT_THAT(Verified(authority, stolen, at("bank.example", 0)), HasSubstr("permitted subtree"));
  EXPECT_THAT(EnglishTexts(CertificateWarnings(first.certificate_pem, begin_)), IsEmpty());
}

TEST_F(AuthorityTest, ItIssuesWhatBrowsersTakeForAsLongAsThatIsValid) {
  const std::string authority = MakeAuthority(names_, begin_);
  const std::chrono::hours day(24);
  EXPECT_TRUE(CanIssue(authority, names_, begin_));
  EXPECT_FALSE(CanIssue(authority, {"renamed.example"}, begin_)) << "not for another name";
  EXPECT_TRUE(CanIssue(authority, {"10.9.9.9", "2001:db8::7"}, begin_)) << "addresses change";
  EXPECT_FALSE(CanIssue(authority, names_, begin_ - 2 * day)) << "its clock was wrong";
  EXPECT_TRUE(CanIssue(authority, names_, begin_ + (7300 - 399) * day));
  EXPECT_FALSE(CanIssue(authority, names_, begin_ + (7300 - 397) * day));
  EXPECT_THROW((void)CanIssue("no authority", names_, begin_), DataError);
  EXPECT_THROW((void)IssueTlsIdentity(MakeTlsIdentity({}).certificate_pem, names_, begin_),
               DataError)
      << "without a key";
  const TlsIdentity own = IssueTlsIdentity(authority, names_, begin_);
  const auto left =
      system_clock::from_time_t(FactsOfCertificate(own.certificate_pem).valid_until) - begin_;
  EXPECT_LE(left + day, 398 * day) << "it begins a day before";
  EXPECT_GT(left, 390 * day);
}

TEST_F(AuthorityTest, WhatItHasSignedIsRenewedAndKnown) {
  const std::string authority = MakeAuthority(names_, begin_);
  const std::string own = IssueTlsIdentity(authority, names_, begin_).certificate_pem;
  const std::chrono::hours day(24);
  EXPECT_FALSE(IsDueForRenewal(own, begin_ + 335 * day, names_));
  EXPECT_TRUE(IsDueForRenewal(own, begin_ + 337 * day, names_));
  EXPECT_TRUE(IsDueForRenewal(own, std::nullopt, {"renamed.example"}));
  ASSERT_TRUE(OwnAuthorityOf(own));
  EXPECT_THAT(authority, HasSubstr(OwnAuthorityOf(own)->pem));
  EXPECT_EQ(OwnAuthorityOf(own)->pem.find("PRIVATE"), std::string::npos);
  for (const std::string& other : {MakeTlsIdentity({}).certificate_pem, Made(kCurve, 100),
                                   own + Made(kCurve, 100), std::string("nothing")})
    EXPECT_FALSE(OwnAuthorityOf(other));
}

TEST_F(CertificateCareTest, WhatIsNoCertificateIsRefused) {
  for (const char* text : {"", "no certificate", "-----BEGIN CERTIFICATE-----\nAAAA\n"})
    EXPECT_THROW((void)CertificateWarnings(text, now_), DataError) << text;
}

}  // namespace
}  // namespace plumb::web
