// SPDX-License-Identifier: Apache-2.0
// A journal that reads, that is stopped, and that is gone: a socket in its place.
#include "daemon/loop/journal_sender.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/files/descriptor.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

class JournalSenderTest : public ::testing::Test {
 protected:
  void Listen() {
    journal_ = std::make_unique<Descriptor>(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    std::memcpy(at.sun_path, path_.data(), path_.size());
    ASSERT_EQ(::bind(journal_->get(), reinterpret_cast<const sockaddr*>(&at), sizeof at), 0);
  }
  std::string Read() const {
    std::array<char, 4096> bytes{};
    const ssize_t size = ::recv(journal_->get(), bytes.data(), bytes.size(), MSG_DONTWAIT);
    return size > 0 ? std::string(bytes.data(), static_cast<std::size_t>(size)) : std::string();
  }
  /// How many entries were waiting.
  int ReadAll() const {
    int count = 0;
    while (!Read().empty()) ++count;
    return count;
  }

  testing::TempFolder folder_;
  const std::string path_ = (folder_ / "journal").string();
  std::unique_ptr<Descriptor> journal_;
};

TEST_F(JournalSenderTest, AnEntryHasItsFieldsAndNoMoreThanThem) {
  Listen();
  JournalSender sender(path_);
  sender.Send("the scan is done\nPRIORITY=0", {{"PRIORITY", "6"}, {"PLUMB_SCAN", "000001"}});
  EXPECT_EQ(Read(), "MESSAGE=the scan is done PRIORITY=0\nPRIORITY=6\nPLUMB_SCAN=000001\n");
}

TEST_F(JournalSenderTest, OneThatDoesNotReadHoldsNothingUpAndTheLossIsSaid) {
  Listen();
  JournalSender sender(path_);
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 5000; ++i) sender.Send("a line", {});
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  const int waited = ReadAll();
  EXPECT_GT(waited, 0);
  ASSERT_LT(waited, 5000) << "there was room for all of them";
  sender.Send("it reads again", {});
  EXPECT_THAT(Read(), HasSubstr("it reads again (" + std::to_string(5000 - waited) + " lines"));
  sender.Send("as ever", {});
  EXPECT_EQ(Read(), "MESSAGE=as ever\n");
}

TEST_F(JournalSenderTest, OneThatIsGoneIsUsedAgainOnceItIsBack) {
  JournalSender sender(path_);
  sender.Send("lost", {});
  Listen();
  sender.Send("kept", {});
  EXPECT_THAT(Read(), HasSubstr("kept (1 lines"));
  journal_.reset();
  ::unlink(path_.c_str());
  sender.Send("lost", {});
  Listen();
  sender.Send("kept", {});
  EXPECT_THAT(Read(), HasSubstr("kept (1 lines"));
}

}  // namespace
}  // namespace plumb
