// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/journal_sender.hpp"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include <fmt/format.h>

namespace plumb {
namespace {

/// As the journal's own protocol has it; a line break would end the field.
void AddField(std::string& entry, std::string_view name, std::string_view value) {
  entry.append(name).append("=").append(value);
  std::replace(entry.end() - static_cast<std::ptrdiff_t>(value.size()), entry.end(), '\n', ' ');
  entry += '\n';
}

bool SendTo(int socket, const std::string& path, const std::string& entry) {
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  if (path.size() >= sizeof to.sun_path) return false;
  std::memcpy(to.sun_path, path.data(), path.size());
  return ::sendto(socket, entry.data(), entry.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                  reinterpret_cast<const sockaddr*>(&to), sizeof to) >= 0;
}

}  // namespace

JournalSender::JournalSender(std::string socket)
    : socket_path_(std::move(socket)), socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}

JournalSender::~JournalSender() {
  if (socket_ >= 0) ::close(socket_);
}

void JournalSender::Send(std::string_view message, const Fields& fields) {
  const std::lock_guard lock(mutex_);
  std::string entry;
  AddField(entry, "MESSAGE",
           num_lost_ == 0
               ? std::string(message)
               : fmt::format("{} ({} lines before it were lost: the journal did not read)", message,
                             num_lost_));
  for (const auto& [name, value] : fields) AddField(entry, name, value);
  num_lost_ = SendTo(socket_, socket_path_, entry) ? 0 : num_lost_ + 1;
}

}  // namespace plumb
