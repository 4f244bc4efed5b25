// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/helper_process.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxSaid = 4096;

}  // namespace

fs::path ProgramInPath(const char* name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder) / name;
    if (program.is_absolute() && ::access(program.c_str(), X_OK) == 0) return program;
  }
  throw IoError(say::backup::AgeMissing(name));
}

Descriptor MemoryFile(std::size_t bytes) {
  Descriptor memory(::memfd_create("plumb", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (memory.get() < 0 || ::ftruncate(memory.get(), static_cast<off_t>(bytes)) != 0 ||
      ::fcntl(memory.get(), F_ADD_SEALS, F_SEAL_GROW) != 0)
    throw IoError(say::backup::AgeNotRun("age", std::strerror(errno)));
  return memory;
}

std::string TextInMemory(const Descriptor& memory, std::size_t most) {
  std::string text(most, '\0');
  const ssize_t got = ::pread(memory.get(), text.data(), text.size(), 0);
  text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  text.resize(std::min(text.size(), text.find('\0')));
  return text;
}

Channel MakeChannel(const std::string& program) {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw IoError(say::backup::AgeNotRun(program, std::strerror(errno)));
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

HelperProcess::HelperProcess(const fs::path& path, std::vector<std::string> arguments, int input,
                             int output)
    : said_(MemoryFile(kMaxSaid)) {
  const std::string program = path.string();
  std::string argument_0 = path.filename().string();
  std::vector<char*> argv{argument_0.data()};
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  std::array<char*, 1> no_environment{nullptr};
  const pid_t parent = ::getpid();
  Channel start = MakeChannel(program);
  pid_ = ::fork();
  if (pid_ < 0) throw IoError(say::backup::AgeNotRun(program, std::strerror(errno)));
  if (pid_ == 0) {  // only what is safe after a fork of one of several threads
    sigset_t none;
    ::sigemptyset(&none);
    struct sigaction as_usual {};
    as_usual.sa_handler = SIG_DFL;
    (void)::setsid();  // no terminal to ask for a passphrase at, nor its Ctrl-C
    if (::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && ::getppid() == parent &&
        ::sigaction(SIGPIPE, &as_usual, nullptr) == 0 &&
        ::sigprocmask(SIG_SETMASK, &none, nullptr) == 0 && ::dup2(input, STDIN_FILENO) >= 0 &&
        ::dup2(output, STDOUT_FILENO) >= 0 && ::dup2(said_.get(), STDERR_FILENO) >= 0)
      ::execve(program.c_str(), argv.data(), no_environment.data());
    const int error = errno;
    (void)!::write(start.its.get(), &error, sizeof error);
    ::_exit(127);
  }
  { const Descriptor closed = std::move(start.its); }
  int error = 0;  // nothing comes if the program was started, which closes the other end
  if (::recv(start.ours.get(), &error, sizeof error, MSG_WAITALL) != sizeof error) return;
  (void)Wait();
  throw IoError(say::backup::AgeNotRun(program, std::strerror(error)));
}
HelperProcess::~HelperProcess() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  (void)Wait();
}

std::string HelperProcess::Wait() {
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  std::string text = ValidUtf8(TextInMemory(said_, kMaxSaid));
  text.resize(std::min(text.size(), text.find('\n')));
  constexpr std::string_view kPrefix = "age: error: ";
  if (text.starts_with(kPrefix)) text.erase(0, kPrefix.size());
  std::erase_if(text, [](unsigned char c) { return c < 0x20 || c == 0x7F; });
  return !text.empty() ? text : ::strsignal(WIFSIGNALED(status) ? WTERMSIG(status) : SIGABRT);
}

}  // namespace plumb
