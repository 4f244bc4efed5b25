// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/reader_program.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <thread>

#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

/// The parent holds the other end of the pipe. Once that is closed, nobody needs this process.
void EndWithParent() {
  ::signal(SIGPIPE, SIG_IGN);
  std::thread([] {
    pollfd pipe{STDOUT_FILENO, 0, 0};
    while (::poll(&pipe, 1, -1) < 0 && errno == EINTR) {
    }
    ::_exit(1);
  }).detach();
}

}  // namespace

void RunReaderProgram(const std::function<int()>& read, const ReaderLimits& limits) {
  EndWithParent();
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  const rlimit memory{limits.memory_bytes, limits.memory_bytes};
  ::setrlimit(RLIMIT_AS, &memory);
#endif
  if (limits.cpu_s > 0) {
    const rlimit time{limits.cpu_s, limits.cpu_s};
    ::setrlimit(RLIMIT_CPU, &time);
  }
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  int code = 1;
  try {
    code = read();
  } catch (const std::exception&) {
  }
  ::_exit(code);
}

void WriteToParent(const void* data, std::size_t size) {
  const auto* from = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t written = ::write(STDOUT_FILENO, from, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw IoError(say::recording::ReaderAlone());
    from += written;
    size -= static_cast<std::size_t>(written);
  }
}

std::string ReaderErrorText(const std::exception& error) {
  using Json = nlohmann::ordered_json;
  constexpr std::size_t kMaxSentence = 512;  // an escaped character has at most 6
  Json json = {{"error", std::string(error.what()).substr(0, kMaxSentence)},
               {"error_message", MessageJson(MessageOf(error))}};
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > kMaxReaderError) {
    json.erase("error_message");
    text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  return text;
}

}  // namespace plumb
