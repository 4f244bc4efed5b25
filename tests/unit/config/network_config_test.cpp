// SPDX-License-Identifier: Apache-2.0
// The sections that name other machines: with whom the unit speaks, and how.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/config/error_of.hpp"

namespace plumb {
namespace {

using testing::ErrorOf;
using ::testing::HasSubstr;

TEST(ConfigTest, ReceivingDicomNeedsKnownSendersAndTlsOrAPrivateAddress) {
  const std::string known = "[dicom]\nenabled = true\nsenders = [\"TPS@10.1.2.3\"]\n";
  EXPECT_EQ(ErrorOf("[dicom]\n"), "no error");
  EXPECT_EQ(ErrorOf(known + "listen = \"192.168.1.20:11112\"\n"), "no error");
  EXPECT_THAT(ErrorOf(known), HasSubstr("needs dicom.listen"));
  EXPECT_THAT(ErrorOf("[dicom]\nenabled = true\nlisten = \"10.0.0.1:11112\"\n"),
              HasSubstr("needs dicom.senders"));
  for (const char* open : {"0.0.0.0", "[::]", "8.8.8.8", "172.32.0.1", "[2001:db8::1]"})
    EXPECT_THAT(ErrorOf(known + fmt::format("listen = \"{}:11112\"\n", open)),
                HasSubstr("without TLS"))
        << open;
  const std::string tls = "tls_certificate = \"/c\"\ntls_key = \"/k\"\n";
  EXPECT_THAT(ErrorOf(known + tls + "listen = \"0.0.0.0:11112\"\n"), HasSubstr("all three"));
  EXPECT_EQ(ErrorOf(known + tls + "tls_trusted = \"/t\"\nlisten = \"0.0.0.0:11112\"\n"),
            "no error");
  for (const char* wrong : {"TPS", "@10.0.0.1", "TPS@host", "SEVENTEEN-LETTERS@10.0.0.1"})
    EXPECT_THAT(ErrorOf(fmt::format("[dicom]\nsenders = [\"{}\"]\n", wrong)),
                HasSubstr("dicom.senders"))
        << wrong;
  EXPECT_THAT(ErrorOf("[dicom]\nport = 104\n"), HasSubstr("port"));
}

TEST(ConfigTest, PatientsDataGoesToNodesWithTlsOrAtPrivateAddresses) {
  for (const std::string key : {"worklist", "results_to"}) {
    const auto error = [&](const std::string& node, const std::string& more = "") {
      return ErrorOf(fmt::format("[dicom]\n{} = \"{}\"\n{}", key, node, more));
    };
    EXPECT_EQ(error("PACS@192.168.1.5:104"), "no error");
    EXPECT_EQ(error("PACS@[fd00::5]:104"), "no error");
    for (const char* open : {"PACS@8.8.8.8:104", "PACS@pacs.example:104"})
      EXPECT_THAT(error(open), HasSubstr("dicom." + key)) << open;
    EXPECT_EQ(error("PACS@pacs.example:2762",
                    "tls_certificate = \"/c\"\ntls_key = \"/k\"\ntls_trusted = \"/t\"\n"),
              "no error");
    for (const char* wrong : {"PACS", "@10.0.0.1:104", "PACS@10.0.0.1", "PACS@10.0.0.1:0",
                              "SEVENTEEN-LETTERS@10.0.0.1:104"})
      EXPECT_THAT(error(wrong), HasSubstr("dicom." + key)) << wrong;
  }
}

TEST(ConfigTest, MessagesGoToPlainAddressesAndBeyondThisMachineOnlyWithTls) {
  EXPECT_EQ(ErrorOf("[messages]\nmail_to = [\"a@b.example\"]\nmail_from = \"c@b.example\"\n"
                    "mail_server = \"smtp://mail.b.example:587\"\nlanguage = \"de\"\n"
                    "check_due = \"07:30\"\n"),
            "no error");
  EXPECT_THAT(ErrorOf("[messages]\nmail_to = [\"a@b.example\"]\n"), HasSubstr("mail_from"));
  EXPECT_THAT(ErrorOf("[messages]\nmail_user = \"x\"\nmail_from = \"c@b\"\n"
                      "mail_to = [\"a@b\"]\n"),
              HasSubstr("mail_password_file"));
  const auto refused = [](const char* key, const std::string& value) {
    EXPECT_THAT(ErrorOf(fmt::format("[messages]\n{} = \"{}\"\n", key, value)), HasSubstr(key))
        << value;
  };
  for (const char* from :
       {"", "a", "a@b@c", "@b", "a@", "a b@c", "a@b\\r\\nRCPT TO:<x@y>", "<a@b>"})
    refused("mail_from", from);
  for (const char* server : {"mail", "http://mail", "smtp://u:p@mail", "smtp://mail:x", "smtp://"})
    refused("mail_server", server);
  for (const char* syslog : {"udp://logs:514", "tcp://logs", "tls://", "unix://log", "syslog"})
    refused("syslog", syslog);
  for (const char* hook : {"http://hook.b.example/", "ftp://hook", "https://user@hook/"})
    refused("webhook", hook);
  for (const char* due : {"9:00", "24:00", "09:60", "noon"}) refused("check_due", due);
  refused("language", "it");
  EXPECT_EQ(ErrorOf("[messages]\nsyslog = \"udp://[fd00::1]:514\"\n"
                    "webhook = \"http://127.0.0.1:9/\"\n"),
            "no error");
}

TEST(ConfigTest, OtherUnitsNeedASecretAndTls) {
  const std::string secret = "secret_file = \"/etc/plumb/peers.secret\"\n";
  const auto units = [](const std::string& one) {
    return fmt::format("[peers]\nunits = [\"{}\"]\n", one);
  };
  EXPECT_EQ(ErrorOf(units("https://plumb-b.example:8080") + secret), "no error");
  EXPECT_EQ(ErrorOf(units("http://127.0.0.1:8080") + secret), "no error");
  EXPECT_EQ(ErrorOf("[peers]\n" + secret), "no error")
      << "this unit answers other units and queries none";
  EXPECT_THAT(ErrorOf(units("https://plumb-b.example:8080")), HasSubstr("peers.secret_file"));
  for (const char* wrong : {"http://plumb-b.example", "https://b.example/path", "plumb-b",
                            "https://u@b.example", "ftp://127.0.0.1"})
    EXPECT_THAT(ErrorOf(units(wrong) + secret), HasSubstr("peers.units")) << wrong;
  EXPECT_THAT(ErrorOf("[peers]\nsecret = \"x\"\n"), HasSubstr("secret"));
}

TEST(ConfigTest, ADirectoryNeedsWhoAsksWhereAndWhichGroups) {
  const std::string url = "[directory]\nurl = \"ldaps://directory.example\"\n";
  const std::string person = "person = \"uid={name},ou=people,dc=example\"\n";
  const std::string base = "groups_base = \"ou=groups,dc=example\"\n";
  const std::string groups = "physicists = [\"cn=physicists,ou=groups,dc=example\"]\n";
  EXPECT_EQ(ErrorOf(url + person + base + groups), "no error");
  EXPECT_EQ(ErrorOf("[directory]\n" + person), "no error") << "without a url there is none";
  for (const std::string& missing : {person + base, person + groups, base + groups})
    EXPECT_THAT(ErrorOf(url + missing), HasSubstr("directory.url needs")) << missing;
  for (const char* wrong : {"https://d.example", "ldaps://", "ldap://u@d.example",
                            "ldaps://d.example/dc=example", "ldaps://d.example?uid"})
    EXPECT_THAT(ErrorOf(fmt::format("[directory]\nurl = \"{}\"\n", wrong)),
                HasSubstr("directory.url"))
        << wrong;
  EXPECT_THAT(ErrorOf("[directory]\nperson = \"uid=anna\"\n"), HasSubstr("a text with {name}"));
  EXPECT_THAT(ErrorOf("[directory]\ngroups_filter = \"member={person}\"\n"),
              HasSubstr("(member={person})"));
  EXPECT_THAT(ErrorOf("[directory]\ngroups_filter = \"(objectClass=groupOfNames)\"\n"),
              HasSubstr("(member={person})"))
      << "each group would be everybody's";
  EXPECT_EQ(ErrorOf(url + person + base + groups + "groups_filter = \"(memberUid={name})\"\n"),
            "no error");
  EXPECT_THAT(ErrorOf(url + person + base + groups + "people_base = \"dc=example\"\n"),
              HasSubstr("belong together"));
}

TEST(ConfigTest, GroupsAndPeopleOfTheDirectoryAreNamesThatItKnows) {
  const std::string url = "[directory]\nurl = \"ldaps://directory.example\"\n";
  for (const char* role : {"engineers", "physicists", "technicians"})
    for (const char* wrong : {"therapists", "=therapists"})
      EXPECT_THAT(ErrorOf(fmt::format("[directory]\n{} = [\"{}\"]\n", role, wrong)),
                  HasSubstr("names of groups such as"))
          << role;
  // As Active Directory takes it: no entry, and so no member of any group.
  const std::string login = "person = \"{name}@clinic.example\"\n";
  const std::string rest =
      "groups_base = \"ou=groups,dc=example\"\nphysicists = [\"cn=p,ou=groups,dc=example\"]\n";
  EXPECT_THAT(ErrorOf(url + login + rest), HasSubstr("no group has it as a member"));
  EXPECT_THAT(ErrorOf(url + login + rest + "groups_filter = \"(member={person})\"\n"),
              HasSubstr("{person}"));
  EXPECT_EQ(ErrorOf(url + login + rest + "groups_filter = \"(memberUid={name})\"\n"), "no error");
  EXPECT_EQ(ErrorOf(url + login + rest +
                    "people_base = \"dc=example\"\npeople_filter = \"(sAMAccountName={name})\"\n"),
            "no error");
}

TEST(ConfigTest, AChannelOfUpdatesNeedsItsKeyAndTls) {
  const std::string key = "channel_key = \"2RxgFSNjDpGISHQmSN0earBA6NTyA+BYzefuXmYB5ew=\"\n";
  EXPECT_EQ(ErrorOf("[update]\nchannel = \"https://u.example/plumb\"\n" + key), "no error");
  EXPECT_THAT(ErrorOf("[update]\nchannel = \"https://u.example/plumb\"\n"),
              HasSubstr("channel_key"));
  for (const char* url : {"http://u.example/plumb", "https://u.example/?x", "file:///plumb"})
    EXPECT_THAT(ErrorOf(fmt::format("[update]\nchannel = \"{}\"\n", url) + key),
                HasSubstr("update.channel"))
        << url;
  EXPECT_THAT(ErrorOf("[update]\nchannel_name = \"fast\"\n"), HasSubstr("channel_name"));
}

}  // namespace
}  // namespace plumb
