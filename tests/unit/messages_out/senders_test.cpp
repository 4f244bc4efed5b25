// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/senders.hpp"

#include <sys/stat.h>
#include <sys/un.h>

#include <chrono>
#include <fstream>
#include <mutex>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sodium.h>
#include <nlohmann/json.hpp>

#include "tests/support/fake_peer.hpp"
#include "tests/support/temp_folder.hpp"
#include "words/messages.hpp"

namespace plumb {
namespace {

using testing::FakePeer;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing::PeerConnection;

/// What a fake server heard, and when it is to be looked at.
class Heard {
 public:
  void Add(const std::string& text) {
    const std::lock_guard lock(mutex_);
    text_ += text;
  }
  std::string text() const {
    const std::lock_guard lock(mutex_);
    return text_;
  }

 private:
  mutable std::mutex mutex_;
  std::string text_;
};

std::string FromBase64(const std::string& text) {
  std::string bytes(text.size(), '\0');
  std::size_t length = 0;
  EXPECT_EQ(
      sodium_base642bin(reinterpret_cast<unsigned char*>(bytes.data()), bytes.size(), text.data(),
                        text.size(), "\r\n", &length, nullptr, sodium_base64_VARIANT_ORIGINAL),
      0);
  bytes.resize(length);
  return bytes;
}

class SendersTest : public ::testing::Test {
 protected:
  void SetUp() override {
    message_ = {.id = "abc123",
                .unit = "plumb-3",
                .time = WallClock::time_point(std::chrono::seconds(1'772'000'000)),
                .kind = OccasionKind::kApproval,
                .text = say::messages::ApprovalWaiting(2)};
    settings_.mail_to = {"a@clinic.example", "b@clinic.example"};
    settings_.mail_from = "plumb-3@clinic.example";
    std::ofstream(folder_ / "trusted.pem") << identity_.certificate_pem;
    settings_.trusted = folder_ / "trusted.pem";
  }

  /// A mail server. @param offers_tls  By STARTTLS.
  std::function<void(PeerConnection&)> MailServer(bool offers_tls) {
    return [this, offers_tls](PeerConnection& client) {
      client.Write("220 mail ready\r\n");
      for (std::string line; !(line = client.ReadTo("\r\n")).empty();) {
        heard_.Add(line);
        if (line.starts_with("EHLO")) {
          client.Write(offers_tls && !in_tls_ ? "250-mail\r\n250 STARTTLS\r\n"
                                              : "250-mail\r\n250 AUTH PLAIN\r\n");
        } else if (line.starts_with("STARTTLS")) {
          client.Write("220 go\r\n");
          if (!client.StartTls(identity_)) return;
          in_tls_ = true;
        } else if (line.starts_with("AUTH PLAIN")) {
          client.Write("334 \r\n");
          heard_.Add(client.ReadTo("\r\n"));
          client.Write("235 known\r\n");
        } else if (line.starts_with("DATA")) {
          client.Write("354 go on\r\n");
          heard_.Add(client.ReadTo("\r\n.\r\n"));
          client.Write("250 taken\r\n");
        } else if (line.starts_with("QUIT")) {
          client.Write("221 bye\r\n");
          return;
        } else {
          client.Write("250 fine\r\n");
        }
      }
    };
  }

  testing::TempFolder folder_;
  const web::TlsIdentity identity_ = web::MakeTlsIdentity({});
  Heard heard_;
  std::atomic<bool> in_tls_ = false;
  OutMessage message_;
  MessagesSettings settings_;
  std::stop_source stop_;
};

TEST_F(SendersTest, AMailGoesOutByStartTlsWithPasswordToEachRecipient) {
  FakePeer server(MailServer(/*offers_tls=*/true));
  std::ofstream(folder_ / "password") << "pass word\n";
  settings_.mail_server = fmt::format("smtp://localhost:{}", server.port());
  settings_.mail_user = "plumb";
  settings_.mail_password_file = folder_ / "password";
  settings_.language = "de";
  ASSERT_EQ(SendMail(message_, settings_, stop_.get_token()), "");
  EXPECT_TRUE(in_tls_);
  const std::string text = heard_.text();
  EXPECT_THAT(text, HasSubstr("MAIL FROM:<plumb-3@clinic.example>"));
  EXPECT_THAT(text, HasSubstr("RCPT TO:<a@clinic.example>"));
  EXPECT_THAT(text, HasSubstr("RCPT TO:<b@clinic.example>"));
  EXPECT_THAT(text, HasSubstr("Date: Wed, 25 Feb 2026 06:13:20 +0000\r\n"));
  EXPECT_THAT(text, HasSubstr("Message-ID: <abc123@clinic.example>\r\n"));
  EXPECT_LT(text.find("STARTTLS"), text.find("AUTH PLAIN")) << "no password in the clear";
  EXPECT_THAT(text, HasSubstr("AHBsdW1iAHBhc3Mgd29yZA=="));
  const std::size_t body = text.find("\r\n\r\n") + 4;
  EXPECT_THAT(FromBase64(text.substr(body, text.rfind("\r\n.\r\n") - body)),
              HasSubstr("2 Referenzen warten auf einen Plan oder eine Freigabe"));
}

TEST_F(SendersTest, ACertificateThatIsNotTrustedGetsNoMail) {
  FakePeer server(MailServer(/*offers_tls=*/true));
  std::ofstream(folder_ / "trusted.pem") << web::MakeTlsIdentity({}).certificate_pem;
  settings_.mail_server = fmt::format("smtp://localhost:{}", server.port());
  EXPECT_THAT(SendMail(message_, settings_, stop_.get_token()), Not(IsEmpty()));
  EXPECT_THAT(heard_.text(), Not(HasSubstr("RCPT")));
}

TEST_F(SendersTest, TheProgramGetsTheMailOnItsInput) {
  std::ofstream(folder_ / "sendmail") << "#!/bin/sh\necho \"$@\" > \"$(dirname $0)/arguments\"\n"
                                         "cat > \"$(dirname $0)/mail\"\n";
  ::chmod((folder_ / "sendmail").c_str(), 0700);
  settings_.sendmail = folder_ / "sendmail";
  ASSERT_EQ(SendMail(message_, settings_, stop_.get_token()), "");
  std::ifstream arguments(folder_ / "arguments");
  std::string line;
  std::getline(arguments, line);
  EXPECT_EQ(line, "-i -f plumb-3@clinic.example -- a@clinic.example b@clinic.example");
  std::ifstream mail(folder_ / "mail");
  std::getline(mail, line);
  EXPECT_EQ(line, "Date: Wed, 25 Feb 2026 06:13:20 +0000\r");
}

TEST_F(SendersTest, AProgramThatIsMissingOrFailsIsSaid) {
  settings_.sendmail = folder_ / "none";
  EXPECT_THAT(SendMail(message_, settings_, stop_.get_token()), HasSubstr("No such file"));
  settings_.sendmail = "/bin/false";
  EXPECT_THAT(SendMail(message_, settings_, stop_.get_token()), HasSubstr("exit code 1"));
}

TEST_F(SendersTest, AProgramThatHangsEndsWithTheStop) {
  std::ofstream(folder_ / "sendmail") << "#!/bin/sh\nexec sleep 600\n";
  ::chmod((folder_ / "sendmail").c_str(), 0700);
  settings_.sendmail = folder_ / "sendmail";
  stop_.request_stop();
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_THAT(SendMail(message_, settings_, stop_.get_token()), HasSubstr("exit code -1"));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

constexpr const char* kSyslogLine =
    " - \xEF\xBB\xBF"
    "2 references wait for a plan or an approval";

TEST_F(SendersTest, SyslogByTlsIsFramedByItsLength) {
  FakePeer server([this](PeerConnection& client) {
    if (!client.StartTls(identity_)) return;
    const int length = std::stoi(client.ReadTo(" "));
    heard_.Add(client.ReadBytes(static_cast<std::size_t>(length)));
    heard_.Add("|" + client.ReadTo("more"));
  });
  settings_.syslog = fmt::format("tls://localhost:{}", server.port());
  ASSERT_EQ(SendSyslog(message_, settings_, stop_.get_token()), "");
  const auto latest = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (heard_.text().find('|') == std::string::npos && std::chrono::steady_clock::now() < latest)
    std::this_thread::yield();
  EXPECT_THAT(heard_.text(), ::testing::StartsWith("<132>1 2026-02-25T06:13:20Z plumb-3 plumbd "));
  EXPECT_THAT(heard_.text(), ::testing::EndsWith(std::string(kSyslogLine) + "|"));
}

TEST_F(SendersTest, SyslogByTlsGoesToNobodyElse) {
  FakePeer server([this](PeerConnection& client) {
    if (client.StartTls(identity_)) heard_.Add(client.ReadBytes(1));
  });
  std::ofstream(folder_ / "trusted.pem") << web::MakeTlsIdentity({}).certificate_pem;
  settings_.syslog = fmt::format("tls://localhost:{}", server.port());
  EXPECT_THAT(SendSyslog(message_, settings_, stop_.get_token()), Not(IsEmpty()));
  EXPECT_EQ(heard_.text(), "");
}

TEST_F(SendersTest, SyslogByUdpAndTheLocalSocketIsOneDatagram) {
  const int udp = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  ASSERT_EQ(::bind(udp, reinterpret_cast<sockaddr*>(&address), length), 0);
  ::getsockname(udp, reinterpret_cast<sockaddr*>(&address), &length);
  settings_.syslog = fmt::format("udp://127.0.0.1:{}", ntohs(address.sin_port));
  ASSERT_EQ(SendSyslog(message_, settings_, stop_.get_token()), "");
  char buffer[1024];
  const ssize_t got = ::recv(udp, buffer, sizeof(buffer), 0);
  ::close(udp);
  ASSERT_GT(got, 0);
  EXPECT_THAT(std::string(buffer, static_cast<std::size_t>(got)), ::testing::EndsWith(kSyslogLine));

  const int local = ::socket(AF_UNIX, SOCK_DGRAM, 0);
  sockaddr_un path{};
  path.sun_family = AF_UNIX;
  (folder_ / "log").string().copy(path.sun_path, sizeof(path.sun_path) - 1);
  ASSERT_EQ(::bind(local, reinterpret_cast<sockaddr*>(&path), sizeof(path)), 0);
  settings_.syslog = "unix://" + (folder_ / "log").string();
  ASSERT_EQ(SendSyslog(message_, settings_, stop_.get_token()), "");
  const ssize_t locally = ::recv(local, buffer, sizeof(buffer), 0);
  ::close(local);
  ASSERT_GT(locally, 0);
  EXPECT_THAT(std::string(buffer, static_cast<std::size_t>(locally)),
              ::testing::StartsWith(fmt::format("<132>plumbd[{}]: approval: 2 ", ::getpid())));
  EXPECT_THAT(SendSyslog(
                  message_,
                  [&] {
                    MessagesSettings none = settings_;
                    none.syslog = "unix:///nowhere/log";
                    return none;
                  }(),
                  stop_.get_token()),
              HasSubstr("No such file"));
}

/// Answers one request after the other with a head, and remembers the request.
std::function<void(PeerConnection&)> WebServer(const web::TlsIdentity* identity, Heard& heard,
                                               std::string answer) {
  return [identity, &heard, answer = std::move(answer)](PeerConnection& client) {
    if (identity != nullptr && !client.StartTls(*identity)) return;
    const std::string head = client.ReadTo("\r\n\r\n");
    heard.Add(head);
    const std::size_t length = head.find("Content-Length: ");
    if (length != std::string::npos)
      heard.Add(client.ReadBytes(std::stoul(head.substr(length + 16))));
    client.Write(answer);
  };
}

TEST_F(SendersTest, AWebhookIsSignedAndSaysWhatATextSays) {
  FakePeer server(WebServer(&identity_, heard_, "HTTP/1.1 204 No Content\r\n\r\n"));
  std::ofstream(folder_ / "secret") << "key of the clinic\n";
  settings_.webhook = fmt::format("https://localhost:{}/hook", server.port());
  settings_.webhook_secret_file = folder_ / "secret";
  message_.is_repeated = true;
  ASSERT_EQ(SendWebhook(message_, settings_, stop_.get_token()), "");
  const std::string text = heard_.text();
  EXPECT_THAT(text, ::testing::StartsWith("POST /hook HTTP/1.1\r\n"));
  const std::string body = text.substr(text.find("\r\n\r\n") + 4);
  EXPECT_THAT(text, HasSubstr("X-Plumb-Signature: " + WebhookSignature(body, "key of the clinic")));
  const auto json = nlohmann::json::parse(body);
  EXPECT_EQ(json["text"], "Still so: 2 references wait for a plan or an approval");
  EXPECT_EQ(json["kind"], "approval");
  EXPECT_EQ(json["repeated"], true);
  EXPECT_EQ(json["message"]["id"], "messages.approval_waiting");
  EXPECT_EQ(json["message"]["arguments"]["references"], 2);
}

// RFC 4231, test case 2.
TEST(WebhookSignatureTest, IsHmacSha256) {
  EXPECT_EQ(WebhookSignature("what do ya want for nothing?", "Jefe"),
            "sha256=5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

TEST_F(SendersTest, ARedirectionIsNotFollowedAndARefusalIsSaid) {
  FakePeer elsewhere(WebServer(nullptr, heard_, "HTTP/1.1 200 OK\r\n\r\n"));
  Heard first;
  FakePeer server(WebServer(
      nullptr, first,
      fmt::format("HTTP/1.1 307 Elsewhere\r\nLocation: http://127.0.0.1:{}/\r\nContent-Length: "
                  "0\r\n\r\n",
                  elsewhere.port())));
  settings_.webhook = fmt::format("http://127.0.0.1:{}/hook", server.port());
  EXPECT_EQ(SendWebhook(message_, settings_, stop_.get_token()), "HTTP 307");
  EXPECT_EQ(heard_.text(), "");
}

TEST_F(SendersTest, AnEndlessAnswerIsNotReadToItsEnd) {
  FakePeer server([](PeerConnection& client) {
    (void)client.ReadTo("\r\n\r\n");
    client.Write("HTTP/1.1 200 OK\r\n\r\n");
    while (client.Write(std::string(4096, 'x'))) {
    }
  });
  settings_.webhook = fmt::format("http://127.0.0.1:{}/hook", server.port());
  EXPECT_EQ(SendWebhook(message_, settings_, stop_.get_token()), "") << "200: it was taken";
}

TEST_F(SendersTest, AServerThatSaysNothingIsLeftAtAStop) {
  FakePeer server([](PeerConnection& client) { (void)client.ReadTo("never"); });
  settings_.webhook = fmt::format("http://127.0.0.1:{}/hook", server.port());
  const auto begin = std::chrono::steady_clock::now();
  stop_.request_stop();
  EXPECT_THAT(SendWebhook(message_, settings_, stop_.get_token()), Not(IsEmpty()));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(15));
}

}  // namespace
}  // namespace plumb
