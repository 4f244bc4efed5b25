// SPDX-License-Identifier: Apache-2.0
#include "tests/support/process.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <stdexcept>

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace plumb {
namespace {

/// Programs speak English, whatever language the developer's machine has, unless a test sets
/// another.
[[maybe_unused]] const int kEnglish = ::setenv("LC_ALL", "C.UTF-8", /*overwrite=*/1);

void PrepareChild(const ProcessOptions& options) {
  if (options.num_cpus > 0) {
    cpu_set_t all, some;
    CPU_ZERO(&some);
    sched_getaffinity(0, sizeof(all), &all);
    for (int cpu = 0, taken = 0; cpu < CPU_SETSIZE && taken < options.num_cpus; ++cpu) {
      if (CPU_ISSET(cpu, &all) != 0) CPU_SET(cpu, &some), ++taken;
    }
    sched_setaffinity(0, sizeof(some), &some);
  }
  if (options.max_file_bytes > 0) {
    std::signal(SIGXFSZ, SIG_IGN);  // the write fails instead of the process
    const rlimit limit{static_cast<rlim_t>(options.max_file_bytes),
                       static_cast<rlim_t>(options.max_file_bytes)};
    setrlimit(RLIMIT_FSIZE, &limit);
  }
}

}  // namespace

Process::Process(const std::vector<std::string>& arguments, const ProcessOptions& options) {
  std::array<int, 2> out{}, err{};
  if (pipe2(out.data(), O_CLOEXEC) != 0 || pipe2(err.data(), O_CLOEXEC) != 0)
    throw std::runtime_error("pipe failed");
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    PrepareChild(options);
    const int to = options.stdout_path.empty()
                       ? out[1]
                       : open(options.stdout_path.c_str(), O_WRONLY | O_CLOEXEC);
    dup2(to, STDOUT_FILENO);
    dup2(err[1], STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  close(out[1]);
  close(err[1]);
  out_fd_ = out[0];
  err_fd_ = err[0];
}

Process::~Process() {
  if (pid_ > 0) {
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  if (out_fd_ >= 0) close(out_fd_);
  if (err_fd_ >= 0) close(err_fd_);
}

bool Process::ReadSome() {
  std::array<pollfd, 2> fds = {{{out_fd_, POLLIN, 0}, {err_fd_, POLLIN, 0}}};
  if (out_fd_ < 0 && err_fd_ < 0) return false;
  if (poll(fds.data(), fds.size(), -1) < 0) return errno == EINTR;
  const auto read_from = [](const pollfd& ready, int& fd, std::string& text) {
    if (fd < 0 || ready.revents == 0) return;
    std::array<char, 65536> buffer;
    const ssize_t count = read(fd, buffer.data(), buffer.size());
    if (count > 0) {
      text.append(buffer.data(), static_cast<std::size_t>(count));
    } else {
      close(fd);
      fd = -1;
    }
  };
  read_from(fds[0], out_fd_, out_);
  read_from(fds[1], err_fd_, err_);
  return true;
}

bool Process::WaitForStderr(std::string_view text) {
  while (err_.find(text) == std::string::npos) {
    if (!ReadSome()) return false;
  }
  return true;
}

bool Process::WaitForStdout(std::string_view text) {
  while (out_.find(text) == std::string::npos) {
    if (!ReadSome()) return false;
  }
  return true;
}

void Process::Signal(int signal) const { kill(pid_, signal); }

int Process::Wait() {
  while (ReadSome()) {
  }
  int status = 0;
  waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

RunResult Run(const std::vector<std::string>& arguments, const ProcessOptions& options) {
  Process process(arguments, options);
  RunResult result;
  result.exit_code = process.Wait();
  result.out = process.out();
  result.err = process.err();
  return result;
}

}  // namespace plumb
