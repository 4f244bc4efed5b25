// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/reader_process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/utf8.hpp"
#include "words/recording.hpp"

extern char** environ;

namespace plumb {
namespace {

constexpr int kPipeBytes = 1 << 20;

}  // namespace

ReaderProcess::ReaderProcess(const std::filesystem::path& program,
                             std::vector<std::string> arguments) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw IoError(say::recording::NoPipe(std::strerror(errno)));
  (void)::fcntl(ends[0], F_SETPIPE_SZ, kPipeBytes);
  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  ::posix_spawnattr_init(&attributes);
  sigset_t none;
  sigset_t defaults;
  ::sigemptyset(&none);
  ::sigemptyset(&defaults);
  ::sigaddset(&defaults, SIGPIPE);
  ::posix_spawnattr_setsigmask(&attributes, &none);
  ::posix_spawnattr_setsigdefault(&attributes, &defaults);
  // In its own process group: Ctrl-C at the terminal reaches the parent only, which ends the
  // child.
  ::posix_spawnattr_setflags(
      &attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  std::string name = program.string();
  std::vector<char*> words = {name.data()};
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  const int error =
      ::posix_spawn(&pid_, name.c_str(), &actions, &attributes, words.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::posix_spawnattr_destroy(&attributes);
  ::close(ends[1]);
  descriptor_ = ends[0];
  if (error != 0) {
    pid_ = -1;
    ::close(descriptor_);
    throw IoError(say::recording::CannotRun(name, std::strerror(error)));
  }
}

ReaderProcess::~ReaderProcess() {
  ::close(descriptor_);
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  (void)Reap();
}

ReaderProcess::Got ReaderProcess::Read(void* data, std::size_t size) {
  auto* to = static_cast<char*>(data);
  while (size > 0) {
    pollfd wait{descriptor_, POLLIN, 0};
    const int ready =
        ::poll(&wait, 1, static_cast<int>(std::chrono::milliseconds(kReaderPatience).count()));
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return Got::kSilence;
    const ssize_t got = ::read(descriptor_, to, size);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return Got::kEnd;
    to += got;
    size -= static_cast<std::size_t>(got);
  }
  return Got::kAll;
}

ReaderProcess::End ReaderProcess::Reap() {
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  if (WIFSIGNALED(status)) return {.crashed = true, .code = WTERMSIG(status)};
  return {.crashed = false, .code = WEXITSTATUS(status)};
}

Message ReaderErrorOf(std::string_view text) {
  using Json = nlohmann::ordered_json;
  const auto told = ParseBoundedJsonOrNothing<Json>(text);
  if (!told.is_object() || !told.value("error", Json()).is_string())
    return Message::Verbatim(ValidUtf8(text));
  return MessageFromJson(told.value("error_message", Json()), told["error"].get<std::string>());
}

}  // namespace plumb
