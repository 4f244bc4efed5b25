// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/crash_report.hpp"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace plumb {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

struct End {
  int status = 0;
  std::string reported;  ///< On the standard error.
};

/// What becomes of a process that reports its crashes and does `what`.
End EndOf(const std::function<void()>& what) {
  int ends[2];
  if (::pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(ends[1], STDERR_FILENO);
    ::close(ends[0]);
    ::close(ends[1]);
    const rlimit none{.rlim_cur = 0, .rlim_max = 0};
    ::setrlimit(RLIMIT_CORE, &none);
    ReportCrashes("tested", "1.2.3");
    what();
    ::_exit(0);
  }
  ::close(ends[1]);
  End end;
  char buffer[4096];
  for (ssize_t count = 0; (count = ::read(ends[0], buffer, sizeof(buffer))) > 0;)
    end.reported.append(buffer, static_cast<std::size_t>(count));
  ::close(ends[0]);
  ::waitpid(child, &end.status, 0);
  return end;
}

bool IsSanitized() {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return true;
#else
  return false;
#endif
}

TEST(CrashReportTest, TellsSignalBuildAndCallsAndEndsByTheSignal) {
  if (IsSanitized()) GTEST_SKIP() << "the sanitizer reports crashes itself";
  const std::string patient = "Doe, Jane";
  const End end = EndOf([&] {
    volatile int* nowhere = nullptr;
    *nowhere = static_cast<int>(patient.size());
  });
  ASSERT_TRUE(WIFSIGNALED(end.status)) << end.reported;
  EXPECT_EQ(WTERMSIG(end.status), SIGSEGV);
  EXPECT_THAT(end.reported,
              ContainsRegex("^crashed: SIGSEGV, tested 1.2.3, build id [0-9a-f]{40}; "));
  EXPECT_THAT(end.reported, ContainsRegex("plumb_test_loop[^\n]*\\(.*\\+0x[0-9a-f]+\\)"));
  EXPECT_THAT(end.reported, Not(HasSubstr(patient)));
}

TEST(CrashReportTest, TellsAnAbortAndASignalFromOutside) {
  if (IsSanitized()) GTEST_SKIP() << "the sanitizer reports crashes itself";
  const End abort = EndOf([] { std::abort(); });
  ASSERT_TRUE(WIFSIGNALED(abort.status));
  EXPECT_EQ(WTERMSIG(abort.status), SIGABRT);
  EXPECT_THAT(abort.reported, HasSubstr("crashed: SIGABRT, "));
  const End bus = EndOf([] { ::kill(::getpid(), SIGBUS); });
  ASSERT_TRUE(WIFSIGNALED(bus.status));
  EXPECT_EQ(WTERMSIG(bus.status), SIGBUS);
  EXPECT_THAT(bus.reported, HasSubstr("crashed: SIGBUS, "));
}

/// A stack that has run out has no room for a handler, which therefore needs a separate stack.
TEST(CrashReportTest, TellsThatTheStackHasRunOut) {
  if (IsSanitized()) GTEST_SKIP() << "the sanitizer reports crashes itself";
  struct Deep {
    static int Call(int depth) {
      volatile char room[4096];
      room[0] = static_cast<char>(depth);
      return depth < 0 ? 0 : Call(depth + 1) + room[0];
    }
  };
  const End end = EndOf([] { ::_exit(Deep::Call(1) & 1); });
  ASSERT_TRUE(WIFSIGNALED(end.status)) << end.reported;
  EXPECT_EQ(WTERMSIG(end.status), SIGSEGV);
  EXPECT_THAT(end.reported, HasSubstr("crashed: SIGSEGV, "));
}

TEST(CrashReportTest, AFileThatMayNotGrowIsAnErrorAndNoEnd) {
  const End end = EndOf([] {
    const rlimit small{.rlim_cur = 16, .rlim_max = 16};
    ::setrlimit(RLIMIT_FSIZE, &small);
    std::FILE* const file = std::tmpfile();
    const std::string text(64, 'x');
    if (file == nullptr) ::_exit(2);
    const bool is_refused =
        std::fwrite(text.data(), 1, text.size(), file) != text.size() || std::fflush(file) != 0;
    ::_exit(is_refused && errno == EFBIG ? 7 : 1);
  });
  ASSERT_TRUE(WIFEXITED(end.status)) << end.reported;
  EXPECT_EQ(WEXITSTATUS(end.status), 7);
}

}  // namespace
}  // namespace plumb
