// SPDX-License-Identifier: Apache-2.0
#include "daemon/unit/provisioning.hpp"

#include <sys/stat.h>

#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/security/secrets.hpp"

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

  /// A file with a display of that name, whose key is in display.key.
  std::string DisplayWithKey(const std::string& key, const std::string& name = "Room 1") {
    WriteWholeFile(folder_ / "display.key", key);
    return "[display]\nname = \"" + name + "\"\nkey_file = \"display.key\"\n";
  }

  const std::string kKey = std::string(60, '0') + "beef";
  testing::TempFolder folder_;
  const fs::path file_ = folder_ / "plumb-provision.toml";
};

TEST_F(ProvisioningTest, EachValueArrivesWhereItActs) {
  const web::TlsIdentity identity = web::MakeTlsIdentity({"plumb-3"});
  WriteWholeFile(folder_ / "page.pem", identity.certificate_pem);
  WriteWholeFile(folder_ / "page.key", identity.key_pem);
  const Provisioning given = Read(
      "[unit]\nserial = \"PL-0042\"\nhost_name = \"plumb-3\"\ntime_zone = \"Asia/Kolkata\"\n"
      "[network]\naddress = "
      "\"192.168.10.5/24\"\ngateway = \"192.168.10.1\"\ndns = [\"192.168.10.1\", \"fd00::1\"]\n"
      "time_servers = [\"ntp.example\"]\n[page]\ncertificate = \"page.pem\"\nkey = \"page.key\"\n");
  Apply(given);
  EXPECT_EQ(Written("serial"), "PL-0042\n");
  EXPECT_EQ(Written("host-name"), "plumb-3\n");
  EXPECT_EQ(Written("time-zone"), "Asia/Kolkata\n");
  EXPECT_EQ(Written("network"),
            "[Match]\nName=en* eth*\n[Network]\nMulticastDNS=yes\nAddress=192.168.10.5/24\n"
            "Gateway=192.168.10.1\nDNS=192.168.10.1\nDNS=fd00::1\n");
  EXPECT_EQ(Written("time-servers"), "[Time]\nNTP=ntp.example\n");
  const fs::path key = folder_ / "state" / "page-key.pem";
  const std::string pem = ReadTextFile(key, 1 << 16);
  EXPECT_EQ(web::CheckedTlsIdentity(pem, pem, {}).fingerprint, identity.fingerprint);
  struct stat status {};
  ASSERT_EQ(::stat(key.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600U);
}

TEST_F(ProvisioningTest, WhatIsNotGivenIsTheDefaultAgain) {
  Apply(
      Read("[unit]\nserial = \"A\"\nhost_name = \"a\"\ntime_zone = \"Etc/UTC\"\n"
           "[network]\ntime_servers = [\"t\"]"));
  Apply(Read(""));
  EXPECT_EQ(Written("serial"), "missing");
  EXPECT_EQ(Written("host-name"), "missing");
  EXPECT_EQ(Written("time-zone"), "missing");
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
  for (const char* bad : {"[unit]\nserial = \"a b\"",
                          "[unit]\nserial = 7",
                          "[unit]\ntime_zone = \"Europe/Bielefeld\"",
                          "[unit]\ntime_zone = \"Europe\"",
                          "[unit]\ntime_zone = \"zone.tab\"",
                          "[unit]\ntime_zone = \"../../../etc/passwd\"",
                          "[unit]\ntime_zone = \"/usr/share/zoneinfo/UTC\"",
                          "[unit]\nserial = \"\"",
                          "[unit]\nhost_name = \"-a\"",
                          "[unit]\nhost_name = \"a.b\"",
                          "[unit]\ncolour = \"red\"",
                          "[network]\ngateway = \"10.0.0.1\"",
                          "[network]\ndns = [\"10.0.0.1\"]",
                          "[network]\naddress = \"10.0.0.5/8\"\ndns = [\"10.0.0.1\\nX=1\"]",
                          "[network]\ntime_servers = [\"a b\"]",
                          "[page]\ncertificate = \"page.pem\"",
                          "[page]\ncertificate = \"../page.pem\"\nkey = \"page.key\"",
                          "[page]\ncertificate = \"/etc/shadow\"\nkey = \"page.key\"",
                          "[page]\ncertificate = \"none.pem\"\nkey = \"none.key\"",
                          "[display]\nname = \"Room 1\"",
                          "[display]\nkey_file = \"display.key\"",
                          "[display]\nkey = \"secret\"",
                          "display = 1",
                          "[display]\nname = \"a\"\nkey_file = \"none.key\"",
                          "[display]\nname = \"a\"\nkey_file = \"../display.key\"",
                          "[display]\nname = \"a\"\nkey_file = \"/etc/shadow\"",
                          "[display]\nname = \"a\"\nkey_file = \".\"",
                          "[rooms]",
                          "unit = 1",
                          "[unit",
                          "a = 1"})
    EXPECT_THAT(WhyNot(bad), HasSubstr(folder_.path().string())) << bad;
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ReadProvisioning(folder_ / "none"); }),
              HasSubstr("none"));
}

TEST_F(ProvisioningTest, ADisplayIsKeptByNameAndHashForTheOwnerAloneAndItsKeyIsNot) {
  const Provisioning given = Read(DisplayWithKey(kKey + "\n"));
  ASSERT_TRUE(given.display);
  EXPECT_EQ(given.display->name, "Room 1");
  EXPECT_EQ(given.display->token_hash, web::StoredHashOf(kKey)) << "without the end of the line";
  EXPECT_EQ(Read(DisplayWithKey(kKey + "\r\n")).display->token_hash, given.display->token_hash);
  EXPECT_FALSE(ProvisionedDisplay(folder_ / "state"));
  Apply(given);
  const std::optional<Display> kept = ProvisionedDisplay(folder_ / "state");
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->name, "Room 1");
  EXPECT_EQ(kept->token_hash, given.display->token_hash);
  const fs::path file = folder_ / "state" / "provisioned-display";
  EXPECT_EQ(ReadTextFile(file, 4096).find(kKey), std::string::npos);
  struct stat status {};
  ASSERT_EQ(::stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600U);
  Apply(Read(""));
  EXPECT_TRUE(ProvisionedDisplay(folder_ / "state")) << "like the page's key";
  WriteWholeFile(file, "damaged");
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ProvisionedDisplay(folder_ / "state"); }),
              HasSubstr("provisioned-display: expected a hash"));
}

TEST_F(ProvisioningTest, ADisplaysKeyAndNameOnBothSidesOfEachBound) {
  for (const std::size_t digits : {0U, 1U, 63U, 65U})
    EXPECT_THAT(WhyNot(DisplayWithKey(std::string(digits, 'a'))),
                HasSubstr("plumb-provision.toml:3: display.key_file: " +
                          (folder_ / "display.key").string() +
                          ": expected 64 digits 0-9 and a-f in one line (openssl rand -hex 32), "
                          "found " +
                          std::to_string(digits) + " characters"));
  for (const char other : {'g', 'A', ' ', '\n', '\0', '/', ':', '`'}) {
    std::string key = kKey;
    key[5] = other;
    const std::string why = WhyNot(DisplayWithKey(key));
    EXPECT_THAT(why, HasSubstr("found another character")) << other;
    EXPECT_EQ(why.find("beef"), std::string::npos) << "the key is in no message";
  }
  for (const std::string& good : {std::string(32, 'a'), std::string("R"), std::string("a b._-9")})
    EXPECT_EQ(Read(DisplayWithKey(kKey, good)).display->name, good);
  for (const std::string& bad : {std::string(33, 'a'), std::string(), std::string(" a"),
                                 std::string("a "), std::string("a\\nb"), std::string("a<b")})
    EXPECT_THAT(WhyNot(DisplayWithKey(kKey, bad)),
                HasSubstr("plumb-provision.toml:2: display.name: expected 1 to 32 letters"))
        << bad;
}

TEST_F(ProvisioningTest, AKeyOfAnotherCertificateIsRefused) {
  WriteWholeFile(folder_ / "page.pem", web::MakeTlsIdentity({"a"}).certificate_pem);
  WriteWholeFile(folder_ / "page.key", web::MakeTlsIdentity({"b"}).key_pem);
  EXPECT_NE(WhyNot("[page]\ncertificate = \"page.pem\"\nkey = \"page.key\"\n"), "");
}

}  // namespace
}  // namespace plumb
