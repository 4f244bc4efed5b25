// SPDX-License-Identifier: Apache-2.0
#include "daemon/dicomd/listener.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr int kBacklog = 16;
constexpr std::size_t kMostAssociations = 8;
constexpr std::size_t kMostOfOneAddress = 4;
constexpr rlim_t kMostReceivedBytes = rlim_t{64} << 20;  // of one file, as the importer's limit
constexpr rlim_t kMostMemory = rlim_t{256} << 20;
constexpr rlim_t kMostCpu_s = 60;
constexpr unsigned kLongestAssociation_s = 900;

std::string NumberOf(const sockaddr_storage& address, socklen_t size) {
  std::array<char, NI_MAXHOST> text{};
  if (::getnameinfo(reinterpret_cast<const sockaddr*>(&address), size, text.data(), text.size(),
                    nullptr, 0, NI_NUMERICHOST) != 0)
    return "?";
  constexpr std::string_view kMapped = "::ffff:";
  const std::string number = text.data();
  return number.starts_with(kMapped) ? number.substr(kMapped.size()) : number;
}

void Limit(__rlimit_resource which, rlim_t most) {
  const rlimit limit{most, most};
  (void)::setrlimit(which, &limit);
}

void LimitChild() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  Limit(RLIMIT_AS, kMostMemory);
#endif
  Limit(RLIMIT_FSIZE, kMostReceivedBytes);
  Limit(RLIMIT_CPU, kMostCpu_s);
  Limit(RLIMIT_CORE, 0);
  ::signal(SIGXFSZ, SIG_IGN);  // so that the write fails and the sender gets an error
  ::signal(SIGPIPE, SIG_IGN);
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::alarm(kLongestAssociation_s);
}

Descriptor OpenedAt(const DicomSettings& settings) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST | AI_PASSIVE;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const std::string where = fmt::format("{}:{}", settings.address, settings.port);
  const int wrong = ::getaddrinfo(settings.address.c_str(), std::to_string(settings.port).c_str(),
                                  &hints, &found);
  if (wrong != 0) throw IoError(say::dicom::CannotListen(where, ::gai_strerror(wrong)));
  Descriptor opened(::socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int yes = 1;
  (void)::setsockopt(opened.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const bool is_bound = ::bind(opened.get(), found->ai_addr, found->ai_addrlen) == 0 &&
                        ::listen(opened.get(), kBacklog) == 0;
  const int error = errno;
  ::freeaddrinfo(found);
  if (!is_bound) throw IoError(say::dicom::CannotListen(where, std::strerror(error)));
  return opened;
}

}  // namespace

void Audit(const std::string& line) {
  fmt::print(stderr, "<5>{}\n", line);  // a notice, as systemd reads it
}

Listener::Listener(const DicomSettings& settings)
    : settings_(settings), socket_(OpenedAt(settings)) {
  sockaddr_storage own{};
  socklen_t size = sizeof own;
  (void)::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&own), &size);
  port_ = ntohs(own.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(own).sin6_port
                                          : reinterpret_cast<const sockaddr_in&>(own).sin_port);
}

void Listener::ReapEnded() {
  int status = 0;
  for (pid_t pid = 0; (pid = ::waitpid(-1, &status, WNOHANG)) > 0;) {
    if (WIFSIGNALED(status))
      Audit(fmt::format("association of {} ended by signal {}", children_[pid], WTERMSIG(status)));
    children_.erase(pid);
  }
}

void Listener::AcceptOne(const std::function<void(int, const std::string&)>& serve) {
  sockaddr_storage from{};
  socklen_t size = sizeof from;
  const Descriptor connection(
      ::accept4(socket_.get(), reinterpret_cast<sockaddr*>(&from), &size, SOCK_CLOEXEC));
  if (connection.get() < 0) return;
  const std::string address = NumberOf(from, size);
  const auto is_known = std::ranges::any_of(
      settings_.senders, [&](const DicomSender& sender) { return sender.address == address; });
  const auto of_address =
      std::ranges::count_if(children_, [&](const auto& child) { return child.second == address; });
  if (!is_known) return Audit(fmt::format("refused: unknown address {}", address));
  if (children_.size() >= kMostAssociations ||
      static_cast<std::size_t>(of_address) >= kMostOfOneAddress)
    return Audit(fmt::format("refused: too many connections, of {}", address));
  std::fflush(stderr);
  const pid_t pid = ::fork();
  if (pid == 0) {
    LimitChild();
    serve(connection.get(), address);
    ::_exit(0);
  }
  if (pid > 0) children_[pid] = address;
}

void Listener::Run(const std::function<void(int, const std::string&)>& serve) {
  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int one : {SIGTERM, SIGINT, SIGCHLD}) ::sigaddset(&signals, one);
  ::sigprocmask(SIG_BLOCK, &signals, nullptr);
  const Descriptor told(::signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK));
  while (true) {
    std::array<pollfd, 2> wait = {{{socket_.get(), POLLIN, 0}, {told.get(), POLLIN, 0}}};
    if (::poll(wait.data(), wait.size(), -1) < 0 && errno != EINTR) return;
    signalfd_siginfo signal{};
    while (::read(told.get(), &signal, sizeof signal) == sizeof signal)
      if (signal.ssi_signo != SIGCHLD) return;
    ReapEnded();
    if ((wait[0].revents & POLLIN) != 0) AcceptOne(serve);
  }
}

}  // namespace plumb
