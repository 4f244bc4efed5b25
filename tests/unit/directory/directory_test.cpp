// SPDX-License-Identifier: Apache-2.0
// Questions to OpenLDAP's own server (Debian's slapd): who may log in with which role, over TLS
// only, and what is said when it does not answer.
#include "daemon/directory/directory.hpp"

#include <gmock/gmock.h>
#include <ldap.h>
#include <signal.h>
#include <sys/socket.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <semaphore>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "daemon/directory/ldap_directory.hpp"
#include "drivers/files/descriptor.hpp"
#include "drivers/files/unix_socket.hpp"
#include "tests/support/fake_peer.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/slapd.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/directory/fake_ldap.hpp"
#include "words/directory.hpp"

namespace plumb::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kPassword = testing::Slapd::kPassword;

class QuestionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ::signal(SIGPIPE, SIG_IGN);
    settings_.person = testing::Slapd::kPerson;
    settings_.groups_base = testing::Slapd::kGroups;
    settings_.physicists = {"CN=Physicists, OU=groups,dc=clinic,dc=example"};  // written otherwise
    settings_.technicians = {"cn=therapists,ou=groups,dc=clinic,dc=example"};
  }
  [[nodiscard]] web::DirectoryAnswer Ask(const std::string& name,
                                         const std::string& password = kPassword) const {
    return AskLdap(settings_, name, password, {});
  }
  static std::string Text(const web::DirectoryAnswer& answer) {
    if (!answer.failure.empty()) return "failure: " + answer.failure.English();
    if (!answer.refusal.empty()) return "refused: " + answer.refusal.English();
    if (!answer.matches) return "wrong";
    return answer.role ? std::string(Name(*answer.role)) : "no role";
  }

  testing::TempFolder folder_;
  DirectorySettings settings_;
};

/// A directory that says what a test wants said, behind TLS unless the url is replaced.
class FakeLdapTest : public QuestionTest {
 protected:
  using FakeLdap = testing::FakeLdap;

  void SetUp() override {
    QuestionTest::SetUp();
    settings_.trusted = folder_ / "certificate.pem";
    std::ofstream(settings_.trusted) << identity_.certificate_pem;
  }
  /// What becomes of a question to it.
  std::string AskOne(FakeLdap::Answers answers) {
    const FakeLdap directory(std::move(answers), identity_);
    settings_.url = directory.url();
    return Text(Ask("anna"));
  }

  web::TlsIdentity identity_ = web::MakeTlsIdentity({});
};

class LdapTest : public QuestionTest {
 protected:
  void SetUp() override {
    if (!testing::Slapd::IsInstalled()) PLUMB_SKIP("there is no slapd");
    QuestionTest::SetUp();
    server_.emplace(folder_.path());
    settings_.url = server_->tls_url();
    settings_.trusted = server_->certificate();
  }

  std::optional<testing::Slapd> server_;
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

TEST_F(LdapTest, OnlyAServerWithATrustedCertificateOfItsNameIsAsked) {
  settings_.url = server_->plain_url();
  EXPECT_EQ(Text(Ask("anna")), "technician") << "TLS begins before the password is sent";
  const auto trusted = std::exchange(settings_.trusted, {});
  EXPECT_TRUE(Ask("anna").failure.Is(say::directory::kNotTrusted)) << "by no authority here";
  settings_.url = server_->tls_url();
  EXPECT_TRUE(Ask("anna").failure.Is(say::directory::kNotTrusted)) << "by no authority here";
  settings_.trusted = trusted;
  settings_.url = fmt::format("ldaps://localhost:{}", server_->tls_port());
  EXPECT_TRUE(Ask("anna").failure.Is(say::directory::kNotTrusted)) << "of another name";
}

TEST_F(LdapTest, OfThisMachineItIsAskedThroughItsSocket) {
  settings_.url = server_->local_url();
  EXPECT_EQ(Text(Ask("anna")), "technician");
  EXPECT_EQ(Text(Ask("anna", "another password")), "wrong");
  server_->Stop();
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("does not answer"));
}

TEST_F(FakeLdapTest, WithoutTlsNothingIsSaid) {
  FakeLdap directory({.start_tls = {LDAP_PROTOCOL_ERROR, "no TLS here"}}, std::nullopt);
  settings_.url = directory.url();
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("no TLS here"));
  EXPECT_EQ(directory.kinds(), std::string(1, FakeLdap::kStartTls));
  EXPECT_THAT(directory.received(), HasSubstr("1.3.6.1.4.1.1466.20037"));
}

TEST_F(FakeLdapTest, WhoeverAnswersInItsPlaceHearsNothing) {
  const FakeLdap other({}, web::MakeTlsIdentity({}));
  settings_.url = other.url();
  EXPECT_TRUE(Ask("anna").failure.Is(say::directory::kNotTrusted));
  EXPECT_EQ(other.kinds(), "");
}

TEST_F(FakeLdapTest, ALockedAccountIsARefusalAndNeitherAFailureNorAWrongPassword) {
  EXPECT_THAT(AskOne({.bind = {LDAP_CONSTRAINT_VIOLATION, "Exceed password retry limit"}}),
              AllOf(HasSubstr("refused: "), HasSubstr("Exceed password retry limit")));
  EXPECT_THAT(AskOne({.bind = {LDAP_UNWILLING_TO_PERFORM, "log account expired"}}),
              AllOf(HasSubstr("refused: "), HasSubstr("log account expired")));
  EXPECT_EQ(AskOne({.bind = {LDAP_INVALID_CREDENTIALS}}), "wrong");
}

TEST_F(FakeLdapTest, WhatWentWrongIsCalledWhatItIs) {
  for (const int code : {LDAP_BUSY, LDAP_UNAVAILABLE})
    EXPECT_THAT(AskOne({.search = {code}}), HasSubstr("directory does not answer")) << code;
  for (const int code : {LDAP_TIMELIMIT_EXCEEDED, LDAP_ADMINLIMIT_EXCEEDED, LDAP_OTHER})
    EXPECT_THAT(AskOne({.search = {code}}), HasSubstr("question to the clinic's directory failed"))
        << code;
  for (const int code : {LDAP_NO_SUCH_OBJECT, LDAP_INSUFFICIENT_ACCESS})
    EXPECT_THAT(AskOne({.search = {code}}), HasSubstr("Check the section [directory]")) << code;
}

TEST_F(FakeLdapTest, FiveHundredGroupsAreTakenAndNotOneMore) {
  std::vector<std::string> groups(499, "cn=another,ou=groups,dc=clinic,dc=example");
  groups.push_back("cn=therapists,ou=groups,dc=clinic,dc=example");
  EXPECT_EQ(AskOne({.found = {groups}}), "technician");
  groups.push_back("cn=another,ou=groups,dc=clinic,dc=example");
  EXPECT_THAT(AskOne({.found = {groups}}), HasSubstr("Size limit exceeded"));
}

TEST_F(FakeLdapTest, TheNameOfAnEntryIsTakenAsItIs) {
  settings_.people_base = "dc=clinic,dc=example";
  settings_.people_filter = "(uid={name})";
  settings_.groups_filter = "(|(member={person})(memberUid={name}))";
  FakeLdap directory({.found = {{"cn=of {name},dc=clinic,dc=example"}, {}}}, identity_);
  settings_.url = directory.url();
  EXPECT_EQ(Text(Ask("anna")), "no role");
  EXPECT_THAT(directory.received(), HasSubstr("cn=of {name},dc=clinic,dc=example"));
}

// Its queue holds who is not taken in time; the next one would wait in connect() for ever.
TEST_F(QuestionTest, AServerOfThisMachineThatTakesNobodyIsNotWaitedFor) {
  const std::filesystem::path path = folder_ / "socket";
  const Descriptor listener(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const auto bind = [&](const sockaddr* address, socklen_t size) {
    return ::bind(listener.get(), address, size);
  };
  ASSERT_EQ(WithUnixAddress(path, bind), 0);
  ASSERT_EQ(::listen(listener.get(), 0), 0);
  std::vector<Descriptor> waiting;
  do {
    waiting.emplace_back(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  } while (WithUnixAddress(path, [&](const sockaddr* address, socklen_t size) {
             return ::connect(waiting.back().get(), address, size);
           }) == 0);
  ASSERT_EQ(errno, EAGAIN);
  settings_.url = testing::Slapd::UrlOf(path);
  EXPECT_TRUE(Ask("anna").failure.Is(say::directory::kNoAnswer));
}

TEST_F(LdapTest, AServerThatIsAwayOrNeverSpeaksIsAFailureAndNoWrongPassword) {
  settings_.url = fmt::format("ldaps://127.0.0.1:{}", testing::FreePort());
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("127.0.0.1: Connection refused"));
  settings_.url = server_->tls_url();
  EXPECT_EQ(Text(Ask("anna")), "technician");
  server_->Freeze();
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("does not answer"));
}

TEST_F(LdapTest, WhatTheConfigurationHasWrongIsSaidAndIsNoWrongPassword) {
  const DirectorySettings right = settings_;
  settings_.trusted = "/nowhere/missing.pem";
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("missing.pem, by which"));
  settings_ = right;
  settings_.groups_base = "ou=gruops,dc=clinic,dc=example";
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("refuses the question as the configuration puts it"));
  settings_ = right;
  settings_.person = "{name}@clinic.example";  // as Active Directory takes it
  EXPECT_THAT(Text(Ask("anna")), HasSubstr("refuses the question as the configuration puts it"));
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
