// SPDX-License-Identifier: Apache-2.0
// What is reported about a certificate, on both sides of each limit; openssl makes them.
#include "web/security/certificate_care.hpp"

#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>

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

TEST_F(CertificateCareTest, WhatIsNoCertificateIsRefused) {
  for (const char* text : {"", "no certificate", "-----BEGIN CERTIFICATE-----\nAAAA\n"})
    EXPECT_THROW((void)CertificateWarnings(text, now_), DataError) << text;
}

}  // namespace
}  // namespace plumb::web
