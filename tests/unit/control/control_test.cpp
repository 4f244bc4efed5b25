// SPDX-License-Identifier: Apache-2.0
#include <sys/socket.h>
#include <unistd.h>

#include <fcntl.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "algo/base/errors.hpp"
#include "daemon/control/control_protocol.hpp"
#include "daemon/control/control_server.hpp"
#include "drivers/files/unix_socket.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;
using testing::MessageOf;
using Kind = ControlRequest::Kind;

TEST(ControlProtocolTest, EveryRequestReadsBack) {
  for (const ControlRequest& request :
       {ControlRequest{.kind = Kind::kStatus, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kWatch, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kPress, .is_long = false, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kPress, .is_long = true, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kSim, .action = "next-scene", .argument = {}},
        ControlRequest{
            .kind = Kind::kBackup, .action = {}, .argument = {}, .folder = "/mnt/a \"b\""},
        ControlRequest{.kind = Kind::kBackup,
        .action = {},
        .argument = {},
        .folder = "/mnt/a",
        .recipients = AgeRecipients(
            {"age1z8q8p3f3getd6h87azd0zc2vzskwttwywjqumzv8yqddd73pwg3svc56n6"})},
        ControlRequest{.kind = Kind::kUpdate,
        .action = {},
        .argument = {},
        .folder = {},
        .name = "plumb-0.2_1.raucb"},
        ControlRequest{.kind = Kind::kUpdateStatus, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kPresence, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kTestMessage, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kRestart, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kMonitor, .starts = true, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kMonitor, .starts = false, .action = {}, .argument = {}},
        ControlRequest{.kind = Kind::kSim, .action = "glitch", .argument = "late 30"}}) {
    EXPECT_EQ(ParseControlRequest(ControlRequestText(request)), request);
  }
}

TEST(ControlProtocolTest, AFolderInAnyEncodingIsSentAsUtf8) {
  const ControlRequest request{
      .kind = Kind::kBackup, .action = {}, .argument = {}, .folder = "/mnt/\xff"};
  EXPECT_EQ(ParseControlRequest(ControlRequestText(request)).folder, "/mnt/\xEF\xBF\xBD");
}

TEST(ControlProtocolTest, RefusesEverythingElse) {
  for (const char* line : {"",
                           "status",
                           "[]",
                           "{}",
                           "null",
                           "{\"command\":1}",
                           "{\"command\":\"reboot\"}",
                           "{\"command\":\"status\",\"x\":1}",
                           "{\"command\":\"press\",\"long\":\"yes\"}",
                           "{\"command\":\"sim\"}",
                           "{\"command\":\"monitor\"}",
                           "{\"command\":\"monitor\",\"action\":\"pause\"}",
                           "{\"command\":\"sim\",\"action\":\"explode\"}",
                           "{\"command\":\"sim\",\"action\":\"plug\",\"argument\":7}",
                           "{\"command\":\"sim\",\"action\":\"plug\",\"argument\":\"a\\nb\"}",
                           "{\"command\":\"backup\"}",
                           "{\"command\":\"backup\",\"folder\":\"relative\"}",
                           "{\"command\":\"backup\",\"folder\":7}",
                           "{\"command\":\"backup\",\"folder\":\"/a\",\"recipients\":\"k\"}",
                           "{\"command\":\"backup\",\"folder\":\"/a\",\"recipients\":[7]}",
                           "{\"command\":\"backup\",\"folder\":\"/a\",\"recipients\":[]}",
                           "{\"command\":\"backup\",\"folder\":\"/a\",\"recipients\":{}}",
                           "{\"command\":\"backup\",\"folder\":\"/a\",\"recipients\":[\"age1\"]}",
                           "{\"command\":\"backup\",\"folder\":\"/a\\u0000b\"}",
                           "{\"command\":\"update\"}",
                           "{\"command\":\"update\",\"name\":\".raucb\"}",
                           "{\"command\":\"update\",\"name\":\"../a.raucb\"}",
                           "{\"command\":\"update\",\"name\":\"a b.raucb\"}",
                           "{\"command\":\"update\",\"name\":\"a.deb\"}",
                           "{\"command\":\"restart\",\"name\":\"a.raucb\"}",
                           "{\"command\":\"status\",\"folder\":\"/a\"}",
                           "{\"command\":\"status\",\"a\":{}}",
                           "{\"command\":{\"a\":{\"b\":{}}}}",
                           "{\"command\":\"status\"} {}",
                           "{\"command\":\"status\"",
                           "\xff\xfe"}) {
    EXPECT_THROW((void)ParseControlRequest(line), DataError) << line;
  }
  EXPECT_THROW((void)ParseControlRequest(std::string(100'000, '[')), DataError);
  EXPECT_THAT(MessageOf<DataError>(
                  [] { (void)ParseControlRequest("{\"command\":\"sim\",\"action\":\"x\"}"); }),
              HasSubstr("next-scene"));
}

TEST(UnixSocketTest, WorksAtAPathThatIsLongerThanAnAddress) {
  const testing::TempFolder folder;
  const std::filesystem::path deep = folder / std::string(100, 'd') / std::string(60, 'e');
  std::filesystem::create_directories(deep);
  const int listening = ListenUnix(deep / "control.sock");
  const int client = ConnectUnix(deep / "control.sock");
  EXPECT_GE(client, 0);
  ::close(client);
  ::close(listening);
}

TEST(UnixSocketTest, ReplacesTheSocketOfADeadProcessOnly) {
  const testing::TempFolder folder;
  const int first = ListenUnix(folder / "s");
  EXPECT_THAT(MessageOf<IoError>([&] { (void)ListenUnix(folder / "s"); }),
              HasSubstr("another plumbd"));
  ::close(first);  // the file stays, as after a crash
  const int second = ListenUnix(folder / "s");
  struct stat status {};
  ASSERT_EQ(::stat((folder / "s").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0117, 0U) << "only owner and group have access";
  ::close(second);
  EXPECT_THAT(MessageOf<DeviceError>([&] { ::close(ConnectUnix(folder / "s")); }),
              HasSubstr("running"));
}

/// A server whose handler echoes the command, and clients that live on their own threads.
class ControlServerTest : public ::testing::Test {
 protected:
  ControlServerTest()
      : server_(loop_, ListenUnix(folder_ / "s"),
                [this](const auto& request, const auto& reply) { Handle(request, reply); },
                {.max_clients = 4, .max_waiting = 64 << 10}) {}

  void Handle(const ControlRequest& request, const ControlServer::Reply& reply) {
    if (request.kind == Kind::kRestart) throw std::runtime_error("no answer can be made");
    if (request.kind == Kind::kSim) {  // answered later
      later_ = loop_.MakeTimer("later", [reply] { reply(ControlDone()); });
      later_.ArmAfter(std::chrono::milliseconds(20));
    } else if (request.kind == Kind::kUpdate) {
      std::string text(16, '\0');
      const ssize_t count = ::pread(request.file->fd(), text.data(), text.size(), 0);
      reply(request.name + ' ' + text.substr(0, static_cast<std::size_t>(std::max(count, {}))));
    } else {
      reply(ControlDone());
    }
  }

  /// With descriptors that go along.
  static void SendWith(int fd, const std::string& text, const std::vector<int>& attached) {
    iovec part{.iov_base = const_cast<char*>(text.data()), .iov_len = text.size()};
    std::vector<char> space(CMSG_SPACE(attached.size() * sizeof(int)));
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = space.data();
    message.msg_controllen = space.size();
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(attached.size() * sizeof(int));
    std::memcpy(CMSG_DATA(header), attached.data(), attached.size() * sizeof(int));
    (void)::sendmsg(fd, &message, MSG_NOSIGNAL);
  }
  [[nodiscard]] static std::ptrdiff_t NumOpenFiles() {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  }

  static void Send(int fd, const std::string& text) {
    (void)::send(fd, text.data(), text.size(), MSG_NOSIGNAL);
  }
  /// Until the end of a line, or of the connection.
  static std::string ReadLine(int fd) {
    std::string line;
    for (char c = 0; ::recv(fd, &c, 1, 0) == 1 && c != '\n';) line += c;
    return line;
  }
  /// Runs the loop while `client` does its part on another thread.
  template <typename Client>
  void RunWith(const Client& client) {
    std::jthread thread([&] {
      client();
      loop_.Quit(0);
    });
    loop_.Run();
  }

  testing::TempFolder folder_;
  EventLoop loop_;
  ControlServer server_;
  EventLoop::Source later_;
};

TEST_F(ControlServerTest, AnswersSeveralRequestsInOnePieceAndOneInSeveral) {
  RunWith([&] {
    const int fd = ConnectUnix(folder_ / "s");
    Send(fd, "{\"command\":\"status\"}\n{\"command\":\"status\"}\n{\"comm");
    EXPECT_EQ(ReadLine(fd), ControlDone());
    EXPECT_EQ(ReadLine(fd), ControlDone());
    Send(fd, "and\":\"status\"}\n");
    EXPECT_EQ(ReadLine(fd), ControlDone());
    ::close(fd);
  });
}

TEST_F(ControlServerTest, AnAnswerThatFailsEndsItsConnectionAndNotTheLoop) {
  RunWith([&] {
    const int fd = ConnectUnix(folder_ / "s"), other = ConnectUnix(folder_ / "s");
    const timeval longest{.tv_sec = 10, .tv_usec = 0};  // a loop that has ended answers nothing
    for (const int client : {fd, other})
      ASSERT_EQ(::setsockopt(client, SOL_SOCKET, SO_RCVTIMEO, &longest, sizeof longest), 0);
    Send(fd, "{\"command\":\"restart\"}\n");
    EXPECT_THAT(ReadLine(fd), HasSubstr("no answer can be made"));
    EXPECT_EQ(ReadLine(fd), "") << "it has ended";
    Send(other, "{\"command\":\"status\"}\n");
    EXPECT_EQ(ReadLine(other), ControlDone());
    ::close(fd);
    ::close(other);
  });
}

TEST_F(ControlServerTest, WhoStopsWritingStillGetsALateAnswer) {
  RunWith([&] {
    const int fd = ConnectUnix(folder_ / "s");
    Send(fd, "{\"command\":\"sim\",\"action\":\"plug\"}\n");
    ::shutdown(fd, SHUT_WR);
    EXPECT_EQ(ReadLine(fd), ControlDone());
    EXPECT_EQ(ReadLine(fd), "") << "and then the connection ends";
    ::close(fd);
  });
  EXPECT_EQ(server_.num_clients(), 0U);
}

TEST_F(ControlServerTest, AWatcherThatNeverReadsIsDroppedAndOthersAreNot) {
  const int deaf = ConnectUnix(folder_ / "s"), good = ConnectUnix(folder_ / "s");
  Send(deaf, "{\"command\":\"watch\"}\n");
  Send(good, "{\"command\":\"watch\"}\n");
  constexpr int kLines = 1000;
  int received = 0;
  RunWith([&] {
    EXPECT_EQ(ReadLine(good), ControlDone());
    for (; received < kLines; ++received) {
      loop_.Post("broadcast",
                 [&] { server_.Broadcast("{\"event\":\"" + std::string(1000, 'x') + "\"}"); });
      if (ReadLine(good).size() < 1000) break;
    }
  });
  EXPECT_EQ(received, kLines);
  EXPECT_EQ(server_.num_clients(), 1U) << "a megabyte was more than may wait for the deaf one";
  ::close(deaf);
  ::close(good);
}

TEST_F(ControlServerTest, RequestsThatWaitForTheirAnswersAreBounded) {
  const int most = ControlServerOptions{}.max_unanswered;
  RunWith([&] {
    const int fd = ConnectUnix(folder_ / "s");
    // The handler of this test answers only the last of those that come together.
    const std::string request = "{\"command\":\"sim\",\"action\":\"plug\"}\n";
    std::string burst;
    for (int i = 0; i < most; ++i) burst += request;
    Send(fd, burst);
    EXPECT_EQ(ReadLine(fd), ControlDone());
    Send(fd, request);  // takes the place of the one that was answered
    EXPECT_EQ(ReadLine(fd), ControlDone());
    Send(fd, request + request);
    EXPECT_THAT(ReadLine(fd), HasSubstr(std::to_string(most) + " requests of this connection"));
    EXPECT_EQ(ReadLine(fd), ControlDone()) << "of the one before";
    ::close(fd);
  });
}

TEST_F(ControlServerTest, AFloodThatNeverReadsItsAnswersCostsOthersNothing) {
  RunWith([&] {
    std::vector<std::jthread> floods;
    for (int i = 0; i < 2; ++i) {
      floods.emplace_back([&](const std::stop_token& stop) {
        const std::string requests = "{\"command\":\"status\"}\n{}\n{\"command\":\"status\"}\n";
        while (!stop.stop_requested()) {
          const int fd = ConnectUnix(folder_ / "s");
          while (::send(fd, requests.data(), requests.size(), MSG_NOSIGNAL) > 0 &&
                 !stop.stop_requested()) {
          }
          ::close(fd);  // dropped for what it has not read
        }
      });
    }
    const int good = ConnectUnix(folder_ / "s");
    int answered = 0;
    for (; answered < 500; ++answered) {
      Send(good, "{\"command\":\"status\"}\n");
      if (ReadLine(good) != ControlDone()) break;
    }
    EXPECT_EQ(answered, 500);
    ::close(good);
  });
}

TEST_F(ControlServerTest, AnOpenFileComesAlongAndWhatNobodyAskedForIsClosed) {
  std::ofstream(folder_ / "bundle") << "what is in it";
  const int file = ::open((folder_ / "bundle").c_str(), O_RDONLY | O_CLOEXEC);
  const std::string update = "{\"command\":\"update\",\"name\":\"a.raucb\"}\n";
  const auto before = NumOpenFiles();
  RunWith([&] {
    const int fd = ConnectUnix(folder_ / "s");
    Send(fd, update);
    EXPECT_THAT(ReadLine(fd), HasSubstr("must come along"));
    SendWith(fd, update, {file});
    EXPECT_EQ(ReadLine(fd), "a.raucb what is in it");
    Send(fd, update);
    EXPECT_THAT(ReadLine(fd), HasSubstr("must come along")) << "it was for one request";
    for (int i = 0; i < 50; ++i) {
      SendWith(fd, "{\"command\":\"status\"}\n", {file, file, file});
      EXPECT_EQ(ReadLine(fd), ControlDone());
    }
    ::close(fd);
  });
  EXPECT_LE(NumOpenFiles(), before + 3) << "the loop's own, at most";
  ::close(file);
}

TEST_F(ControlServerTest, WatchersKeepTheirPlacesAndOneTooManyIsToldSo) {
  RunWith([&] {
    std::vector<int> fds;
    for (int i = 0; i < 4; ++i) {
      fds.push_back(ConnectUnix(folder_ / "s"));
      Send(fds.back(), "{\"command\":\"watch\"}\n");
      EXPECT_EQ(ReadLine(fds.back()), ControlDone());
    }
    const int fifth = ConnectUnix(folder_ / "s");
    EXPECT_THAT(ReadLine(fifth), HasSubstr("4 others are connected"));
    EXPECT_EQ(ReadLine(fifth), "");
    ::close(fifth);
    for (const int fd : fds) ::close(fd);
    std::string answer;  // the loop notices the free places in its own time
    while (answer != ControlDone()) {
      const int fd = ConnectUnix(folder_ / "s");
      Send(fd, "{\"command\":\"status\"}\n");
      answer = ReadLine(fd);
      ::close(fd);
    }
  });
}

TEST_F(ControlServerTest, WhoAsksNothingDoesNotKeepOthersOut) {
  RunWith([&] {
    std::vector<int> idle;
    for (int i = 0; i < 40; ++i) idle.push_back(ConnectUnix(folder_ / "s"));
    const int asker = ConnectUnix(folder_ / "s");
    Send(asker, "{\"command\":\"status\"}\n");
    EXPECT_EQ(ReadLine(asker), ControlDone());
    EXPECT_EQ(ReadLine(idle.front()), "") << "it was there first, and asked nothing";
    ::close(asker);
    for (const int fd : idle) ::close(fd);
  });
}

}  // namespace
}  // namespace plumb
