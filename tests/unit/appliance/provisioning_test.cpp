#include "daemon/appliance/provisioning.hpp"

#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageOf;

class ProvisioningTest : public ::testing::Test {
 protected:
  Provisioning Read(const std::string& text) {
    WriteWholeFile(file_, text);
    return ReadProvisioning(file_);
  }
  std::string WhyNot(const std::string& text) {
    return MessageOf<DataError>([&] { (void)Read(text); });
  }
  std::string Written(const char* name) {
    return fs::exists(folder_ / "unit" / name) ? ReadTextFile(folder_ / "unit" / name, 4096)
                                               : "missing";
  }
  void Apply(const Provisioning& given) {
    fs::create_directories(folder_ / "state");
    ApplyProvisioning(given, folder_ / "unit", folder_ / "state");
  }

  testing::TempFolder folder_;
  const fs::path file_ = folder_ / "plumb-provision.toml";
};

TEST_F(ProvisioningTest, EachValueArrivesWhereItActs) {
  const web::TlsIdentity identity = web::MakeTlsIdentity({"plumb-3"});
  WriteWholeFile(folder_ / "page.pem", identity.certificate_pem);
  WriteWholeFile(folder_ / "page.key", identity.key_pem);
  const Provisioning given = Read(
      "[unit]\nserial = \"PL-0042\"\nhost_name = \"plumb-3\"\n[network]\naddress = "
      "\"192.168.10.5/24\"\ngateway = \"192.168.10.1\"\ndns = [\"192.168.10.1\", \"fd00::1\"]\n"
      "time_servers = [\"ntp.example\"]\n[page]\ncertificate = \"page.pem\"\nkey = \"page.key\"\n");
  Apply(given);
  EXPECT_EQ(Written("serial"), "PL-0042\n");
  EXPECT_EQ(Written("host-name"), "plumb-3\n");
  EXPECT_EQ(Written("network"),
            "[Match]\nName=en* eth*\n[Network]\nMulticastDNS=yes\nAddress=192.168.10.5/24\n"
            "Gateway=192.168.10.1\nDNS=192.168.10.1\nDNS=fd00::1\n");
  EXPECT_EQ(Written("time-servers"), "[Time]\nNTP=ntp.example\n");
  const fs::path key = folder_ / "state" / "page-key.pem";
  const std::string pem = ReadTextFile(key, 1 << 16);
  EXPECT_EQ(web::CheckedTlsIdentity(pem, pem, "kept").fingerprint, identity.fingerprint);
  struct stat status {};
  ASSERT_EQ(::stat(key.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600U);
}

TEST_F(ProvisioningTest, WhatIsNotGivenIsTheDefaultAgain) {
  Apply(Read("[unit]\nserial = \"A\"\nhost_name = \"a\"\n[network]\ntime_servers = [\"t\"]"));
  Apply(Read(""));
  EXPECT_EQ(Written("serial"), "missing");
  EXPECT_EQ(Written("host-name"), "missing");
  EXPECT_EQ(Written("time-servers"), "missing");
  EXPECT_THAT(Written("network"), HasSubstr("DHCP=yes"));
  EXPECT_FALSE(fs::exists(folder_ / "state" / "page-key.pem"));
}

TEST_F(ProvisioningTest, BothSidesOfEachBound) {
  EXPECT_EQ(Read("[unit]\nserial = \"" + std::string(32, 'a') + "\"").serial.size(), 32U);
  EXPECT_THAT(WhyNot("[unit]\nserial = \"" + std::string(33, 'a') + "\""),
              HasSubstr("plumb-provision.toml:2: unit.serial"));
  EXPECT_EQ(Read("[unit]\nhost_name = \"" + std::string(63, 'a') + "\"").host_name.size(), 63U);
  EXPECT_NE(WhyNot("[unit]\nhost_name = \"" + std::string(64, 'a') + "\""), "");
  for (const char* good : {"10.0.0.1/1", "10.0.0.1/32", "fd00::5/128"})
    EXPECT_EQ(Read(std::string("[network]\naddress = \"") + good + "\"").address, good);
  for (const char* bad : {"10.0.0.1", "10.0.0.1/0", "10.0.0.1/33", "fd00::5/129", "10.0.0/8",
                          "10.0.0.1/8\\nDNS=1.1.1.1", "10.0.0.1/8x", "", "name/24"})
    EXPECT_NE(WhyNot(std::string("[network]\naddress = \"") + bad + "\""), "") << bad;
  EXPECT_THAT(Read("[network]\ntime_servers = [\"a.b-c\", \"10.0.0.1\"]").time_servers,
              ElementsAre("a.b-c", "10.0.0.1"));
}

TEST_F(ProvisioningTest, NothingHostileIsTakenOver) {
  for (const char* bad :
       {"[unit]\nserial = \"a b\"", "[unit]\nserial = 7", "[unit]\nserial = \"\"",
        "[unit]\nhost_name = \"-a\"", "[unit]\nhost_name = \"a.b\"", "[unit]\ncolour = \"red\"",
        "[network]\ngateway = \"10.0.0.1\"", "[network]\ndns = [\"10.0.0.1\"]",
        "[network]\naddress = \"10.0.0.5/8\"\ndns = [\"10.0.0.1\\nX=1\"]",
        "[network]\ntime_servers = [\"a b\"]", "[page]\ncertificate = \"page.pem\"",
        "[page]\ncertificate = \"../page.pem\"\nkey = \"page.key\"",
        "[page]\ncertificate = \"/etc/shadow\"\nkey = \"page.key\"",
        "[page]\ncertificate = \"none.pem\"\nkey = \"none.key\"", "[rooms]", "unit = 1", "[unit",
        "a = 1"})
    EXPECT_THAT(WhyNot(bad), HasSubstr(folder_.path().string())) << bad;
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadProvisioning(folder_ / "none"); }),
              HasSubstr("none"));
}

TEST_F(ProvisioningTest, AKeyOfAnotherCertificateIsRefused) {
  WriteWholeFile(folder_ / "page.pem", web::MakeTlsIdentity({"a"}).certificate_pem);
  WriteWholeFile(folder_ / "page.key", web::MakeTlsIdentity({"b"}).key_pem);
  EXPECT_NE(WhyNot("[page]\ncertificate = \"page.pem\"\nkey = \"page.key\"\n"), "");
}

}  // namespace
}  // namespace plumb
