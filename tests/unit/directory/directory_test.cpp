// SPDX-License-Identifier: Apache-2.0
// Questions to OpenLDAP's own server (Debian's slapd): who may log in with which role, over TLS
// only, and what is said when it does not answer.
#include "daemon/directory/directory.hpp"

#include <gmock/gmock.h>
#include <signal.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <memory>
#include <semaphore>

#include <fmt/format.h>

#include "daemon/directory/ldap_directory.hpp"
#include "tests/support/fake_peer.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/process.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb::test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr const char* kServer = "/usr/sbin/slapd";
constexpr const char* kPassword = "a long password";

constexpr const char* kPeople = R"(dn: dc=clinic,dc=example
objectClass: dcObject
objectClass: organization
o: clinic
dc: clinic

dn: ou=people,dc=clinic,dc=example
objectClass: organizationalUnit
ou: people

dn: ou=groups,dc=clinic,dc=example
objectClass: organizationalUnit
ou: groups

{}
dn: cn=physicists,ou=groups,dc=clinic,dc=example
objectClass: groupOfNames
cn: physicists
member: uid=marie,ou=people,dc=clinic,dc=example

dn: cn=therapists,ou=groups,dc=clinic,dc=example
objectClass: groupOfNames
cn: therapists
member: uid=marie,ou=people,dc=clinic,dc=example
member: uid=anna,ou=people,dc=clinic,dc=example
)";

std::string PersonEntry(const std::string& uid, const std::string& title) {
  return fmt::format(
      "dn: uid={0},ou=people,dc=clinic,dc=example\nobjectClass: inetOrgPerson\nuid: {0}\n"
      "cn: {0}\nsn: {0}\ntitle: {1}\nuserPassword: {2}\n\n",
      uid, title, kPassword);
}

class LdapTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fs::exists(kServer)) PLUMB_SKIP("there is no slapd");
    ::signal(SIGPIPE, SIG_IGN);
    ASSERT_EQ(Shell("openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=directory "
                    "-addext subjectAltName=IP:127.0.0.1 -keyout key.pem -out cert.pem"),
              0);
    fs::create_directory(InFolder("data"));
    Write("slapd.conf",
          fmt::format("include /etc/ldap/schema/core.schema\n"
                      "include /etc/ldap/schema/cosine.schema\n"
                      "include /etc/ldap/schema/inetorgperson.schema\n"
                      "modulepath /usr/lib/ldap\nmoduleload back_mdb\n"
                      "TLSCertificateFile {0}/cert.pem\nTLSCertificateKeyFile {0}/key.pem\n"
                      "pidfile {0}/slapd.pid\nargsfile {0}/slapd.args\n"
                      "database mdb\nmaxsize 8388608\nsuffix \"dc=clinic,dc=example\"\n"
                      "directory {0}/data\n",
                      folder_.path().string()));
    Write("people.ldif",
          fmt::format(kPeople, PersonEntry("anna", "one") + PersonEntry("marie", "two") +
                                   PersonEntry("visitor", "two")));
    ASSERT_EQ(Shell("/usr/sbin/slapadd -f slapd.conf -l people.ldif"), 0);
    settings_.url = fmt::format("ldaps://127.0.0.1:{}", tls_port_);
    settings_.trusted = InFolder("cert.pem");
    settings_.person = "uid={name},ou=people,dc=clinic,dc=example";
    settings_.groups_base = "ou=groups,dc=clinic,dc=example";
    settings_.physicists = {"CN=Physicists, OU=groups,dc=clinic,dc=example"};  // written otherwise
    settings_.technicians = {"cn=therapists,ou=groups,dc=clinic,dc=example"};
    StartServer();
  }

  /// It goes to the background once it answers.
  void StartServer() {
    const RunResult started = plumb::Run(
        {kServer, "-f", InFolder("slapd.conf"), "-h",
         fmt::format("ldaps://127.0.0.1:{} ldap://127.0.0.1:{}", tls_port_, plain_port_)});
    ASSERT_EQ(started.exit_code, 0) << started.err;
    std::ifstream(InFolder("slapd.pid")) >> server_;
    ASSERT_GT(server_, 0);
  }
  ~LdapTest() override {
    if (server_ > 0) ::kill(server_, SIGKILL);
  }

  [[nodiscard]] std::string InFolder(const char* name) const {
    return (folder_.path() / name).string();
  }
  void Write(const char* name, const std::string& text) const {
    std::ofstream(InFolder(name)) << text;
  }
  [[nodiscard]] int Shell(const std::string& command) const {
    return std::system(
        fmt::format("cd {} && {} >log 2>&1", folder_.path().string(), command).c_str());
  }
  [[nodiscard]] web::DirectoryAnswer Ask(const std::string& name,
                                         const std::string& password = kPassword) const {
    return AskLdap(settings_, name, password, {});
  }
  static std::string Text(const web::DirectoryAnswer& answer) {
    if (!answer.failure.empty()) return "failure: " + answer.failure.English();
    if (!answer.matches) return "wrong";
    return answer.role ? std::string(Name(*answer.role)) : "no role";
  }

  testing::TempFolder folder_;
  const int tls_port_ = testing::FreePort(), plain_port_ = testing::FreePort();
  DirectorySettings settings_;
  pid_t server_ = 0;
};

TEST_F(LdapTest, TheRoleIsThatOfTheFirstListWithOneOfTheGroups) {
  EXPECT_EQ(Text(Ask("anna")), "technician");
  EXPECT_EQ(Text(Ask("marie")), "physicist") << "of both groups";
  EXPECT_EQ(Text(Ask("visitor")), "no role");
  EXPECT_EQ(Text(Ask("stranger")), "wrong");
  EXPECT_EQ(Text(Ask("anna", "another password")), "wrong");
  // RFC 4513, 5.1.2: the server takes an empty password for a visitor and says yes.
  EXPECT_EQ(Text(Ask("anna", "")), "wrong");
  EXPECT_EQ(Text(Ask("")), "wrong");
}

TEST_F(LdapTest, WhatAPersonTypesIsNoPartOfTheQuestion) {
  for (const char* name :
       {"anna,ou=people", "anna\\", "*", "anna)(uid=*", "uid=anna", "an\"na", "+"})
    EXPECT_EQ(Text(Ask(name)), "wrong") << name;
  settings_.people_base = "dc=clinic,dc=example";
  settings_.people_filter = "(|(uid={name})(title={name}))";
  settings_.person = "uid=anna,ou=people,dc=clinic,dc=example";
  EXPECT_EQ(Text(Ask("marie")), "physicist") << "as whom one logs in is not who one is";
  EXPECT_THAT(Text(Ask("*")), HasSubstr("0 entries of this name"));
  EXPECT_THAT(Text(Ask("two")), HasSubstr("2 entries of this name"));
}

TEST_F(LdapTest, WithoutTlsNothingIsSaid) {
  settings_.url = fmt::format("ldap://127.0.0.1:{}", plain_port_);
  EXPECT_EQ(Text(Ask("anna")), "technician") << "TLS begins before the password is sent";
  const fs::path trusted = std::exchange(settings_.trusted, fs::path());
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("failure")) << "the authority is not trusted";
  settings_.url = fmt::format("ldaps://127.0.0.1:{}", tls_port_);
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("failure"));
  settings_.trusted = trusted;
  settings_.url = fmt::format("ldaps://localhost:{}", tls_port_);
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("failure")) << "another name than the certificate's";
}

TEST_F(LdapTest, AServerThatIsAwayOrNeverSpeaksIsAFailureAndNoWrongPassword) {
  const std::string url = settings_.url;
  settings_.url = fmt::format("ldaps://127.0.0.1:{}", testing::FreePort());
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("Can't contact LDAP server"));
  settings_.url = url;
  EXPECT_EQ(Text(Ask("anna")), "technician");
  ::kill(server_, SIGSTOP);
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("does not answer"));
}

TEST_F(LdapTest, WhatTheConfigurationHasWrongIsSaidAndIsNoWrongPassword) {
  const DirectorySettings right = settings_;
  settings_.trusted = InFolder("missing.pem");
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("missing.pem, by which"));
  settings_ = right;
  settings_.groups_base = "ou=gruops,dc=clinic,dc=example";
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("refuses how the configuration has it asked"));
  settings_ = right;
  settings_.person = "{name}@clinic.example";  // as Active Directory takes it
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("refuses how the configuration has it asked"));
}

TEST_F(LdapTest, AnAnswerWithoutEndIsNotTaken) {
  constexpr std::size_t kMost = 64 << 20;  // what lies in buffers of the network is far less
  std::atomic<std::size_t> taken = 0;
  testing::FakePeer peer([&](testing::PeerConnection& connection) {
    connection.ReadBytes(8);
    // A message of 600 MB.
    if (!connection.Write(std::string("\x30\x84\x23\xc3\x46\x00", 6))) return;
    const std::string part(1 << 16, '\0');
    while (taken < kMost && connection.Write(part)) taken += part.size();
  });
  settings_.url = fmt::format("ldap://127.0.0.1:{}", peer.port());
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("does not answer"));
  EXPECT_LT(taken, kMost);
}

TEST_F(LdapTest, AnAskerThatGoesEndsTheQuestion) {
  std::binary_semaphore is_asked(0);
  std::atomic<int> questions = 0;
  testing::FakePeer silent([&](testing::PeerConnection& connection) {
    ++questions;
    is_asked.release();
    connection.ReadTo("never");
  });
  settings_.url = fmt::format("ldaps://127.0.0.1:{}", silent.port());
  EventLoop loop;
  auto directory = std::make_unique<Directory>(loop, settings_);
  for (int i = 0; i < 4; ++i)
    ASSERT_TRUE(directory->Ask("anna", kPassword, [](const web::DirectoryAnswer&) {}));
  is_asked.acquire();
  const auto begun = std::chrono::steady_clock::now();
  directory.reset();
  // One question alone would take ten seconds.
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(8));
  EXPECT_EQ(questions, 1) << "those that wait are not asked any more";
}

TEST_F(LdapTest, TheLoopHearsTheAnswer) {
  EventLoop loop;
  Directory directory(loop, settings_);
  std::string heard;
  ASSERT_TRUE(directory.Ask("marie", kPassword, [&](const web::DirectoryAnswer& answer) {
    heard = Text(answer);
    loop.Quit(0);
  }));
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_EQ(heard, "physicist");
}

TEST_F(LdapTest, AnAskerThatIsGoneHearsNothing) {
  EventLoop loop;
  auto directory = std::make_unique<Directory>(loop, settings_);
  bool is_heard = false;
  ASSERT_TRUE(
      directory->Ask("marie", kPassword, [&](const web::DirectoryAnswer&) { is_heard = true; }));
  directory.reset();  // once the question is answered
  loop.Post("end", [&] { loop.Quit(0); });
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_FALSE(is_heard);
}

}  // namespace
}  // namespace plumb::test
