// SPDX-License-Identifier: Apache-2.0
#include "daemon/control/control_server.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>
#include <vector>

#include "algo/base/errors.hpp"
#include "words/control.hpp"

namespace plumb {

struct ControlServer::Client {
  int fd = -1;
  std::string in, out;
  bool watches = false;
  /// The peer has shut down writing; it is dropped once it has read its answers.
  bool at_end = false;
  int unanswered = 0;
  std::shared_ptr<const AttachedFile> attached;  ///< Open file for the request that uses it.
  EventLoop::Source source;
  ~Client() {
    source = {};
    if (fd >= 0) ::close(fd);
  }
};

namespace {

/// As recv(). The last open file received is taken over, others are closed.
ssize_t Receive(int fd, std::array<char, 4096>& buffer,
                std::shared_ptr<const AttachedFile>& attached) {
  iovec part{.iov_base = buffer.data(), .iov_len = buffer.size()};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> space;
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = space.data();
  message.msg_controllen = space.size();
  const ssize_t count = ::recvmsg(fd, &message, MSG_CMSG_CLOEXEC);
  if (count < 0) return count;
  for (cmsghdr* part_of = CMSG_FIRSTHDR(&message); part_of != nullptr;
       part_of = CMSG_NXTHDR(&message, part_of)) {
    if (part_of->cmsg_level != SOL_SOCKET || part_of->cmsg_type != SCM_RIGHTS) continue;
    // Space for one is space for two, because the size is rounded up.
    const std::size_t num = (part_of->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (std::size_t i = 0; i < num; ++i) {
      int received = -1;
      std::memcpy(&received, CMSG_DATA(part_of) + i * sizeof(int), sizeof(received));
      attached = std::make_shared<const AttachedFile>(received);  // closes the previous one
    }
  }
  return count;
}

}  // namespace

ControlServer::ControlServer(EventLoop& loop, int listening, Handler handler,
                             const ControlServerOptions& options)
    : loop_(loop), listening_(listening), handler_(std::move(handler)), options_(options) {
  source_ =
      loop_.WatchDescriptor("control", listening_, EPOLLIN, [this](std::uint32_t) { Accept(); });
}

ControlServer::~ControlServer() {
  source_ = {};
  clients_.clear();
  ::close(listening_);
}

void ControlServer::Accept() {
  const int fd = ::accept4(listening_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (fd < 0) return;
  if (clients_.size() >= options_.max_clients && !MakeRoom()) {
    const std::string why =
        ControlRefusal(say::control::OthersConnected(static_cast<std::int64_t>(clients_.size()))) +
        "\n";
    (void)::send(fd, why.data(), why.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    ::close(fd);
    return;
  }
  const std::uint64_t id = next_id_++;
  auto client = std::make_unique<Client>();
  client->fd = fd;
  try {
    client->source =
        loop_.WatchDescriptor("control", fd, EPOLLIN, [this, id](std::uint32_t events) {
          if ((events & EPOLLOUT) != 0) Flush(id);
          if ((events & EPOLLIN) != 0) {
            Read(id);
          } else if ((events & (EPOLLHUP | EPOLLERR)) != 0) {
            Drop(id);  // the client has disconnected
          }
        });
  } catch (const std::runtime_error&) {  // the kernel watches no more of them: this one goes
    return;
  }
  clients_.emplace(id, std::move(client));
}

bool ControlServer::MakeRoom() {
  // By number: the oldest connection is the longest silent one, approximately.
  for (const auto& [id, client] : clients_) {
    if (client->watches || client->unanswered > 0 || !client->out.empty()) continue;
    Drop(id);
    return true;
  }
  return false;
}

void ControlServer::Read(std::uint64_t id) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return;
  Client& client = *found->second;
  std::array<char, 4096> buffer;
  const ssize_t count = Receive(client.fd, buffer, client.attached);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
  if (count < 0) return Drop(id);
  if (count == 0) {
    client.at_end = true;
    // A peer that has shut down only its writing side still gets its answer; a watcher then has
    // nothing to wait for.
    if (client.out.empty() && client.unanswered == 0) return Drop(id);
    client.source.SetEvents(EPOLLOUT);
    return;
  }
  client.in.append(buffer.data(), static_cast<std::size_t>(count));
  for (std::size_t end = 0; (end = client.in.find('\n')) != std::string::npos;) {
    const std::string line = client.in.substr(0, end);
    client.in.erase(0, end + 1);
    HandleLine(id, line);
    if (!clients_.contains(id)) return;
  }
  if (client.in.size() > kMaxControlLine) {
    Send(id, ControlRefusal(say::control::TooLong()));
    Drop(id);
  }
}

void ControlServer::HandleLine(std::uint64_t id, const std::string& line) {
  try {
    ControlRequest request = ParseControlRequest(line);
    Client& client = *clients_.at(id);
    if (client.unanswered >= options_.max_unanswered) {
      throw DataError(say::control::Unanswered(client.unanswered));
    }
    if (request.kind == ControlRequest::Kind::kUpdate) {
      request.file = std::move(client.attached);
      if (!request.file) throw DataError(say::control::NoOpenFile());
    }
    if (request.kind == ControlRequest::Kind::kWatch) client.watches = true;
    ++client.unanswered;
    handler_(request, alive_.WhileAlive([this, id](const std::string& reply) {
      if (const auto found = clients_.find(id); found != clients_.end())
        --found->second->unanswered;
      Send(id, reply);
    }));
  } catch (const DataError& error) {
    Send(id, ControlRefusal(error.message(), /*is_input=*/true));
  } catch (const std::exception& error) {  // it costs this connection, and not plumbd
    Send(id, ControlRefusal(MessageOf(error)));
    Drop(id);
  }
}

void ControlServer::Send(std::uint64_t id, const std::string& line) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return;
  Client& client = *found->second;
  if (client.out.size() + line.size() + 1 > options_.max_waiting) return Drop(id);
  client.out += line;
  client.out += '\n';
  Flush(id);
}

void ControlServer::Flush(std::uint64_t id) {
  const auto found = clients_.find(id);
  if (found == clients_.end()) return;
  Client& client = *found->second;
  while (!client.out.empty()) {
    const ssize_t count =
        ::send(client.fd, client.out.data(), client.out.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) return Drop(id);
    if (count < 0) break;
    client.out.erase(0, static_cast<std::size_t>(count));
  }
  if (client.at_end && client.out.empty() && client.unanswered == 0) return Drop(id);
  const std::uint32_t reading = client.at_end ? 0U : static_cast<std::uint32_t>(EPOLLIN);
  client.source.SetEvents(client.out.empty() ? reading : reading | EPOLLOUT);
}

void ControlServer::Drop(std::uint64_t id) { clients_.erase(id); }

void ControlServer::Broadcast(const std::string& line) {
  std::vector<std::uint64_t> watchers;
  for (const auto& [id, client] : clients_) {
    if (client->watches) watchers.push_back(id);
  }
  for (const std::uint64_t id : watchers) Send(id, line);
}

}  // namespace plumb
