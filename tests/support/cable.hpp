// SPDX-License-Identifier: Apache-2.0
// The network between two programs of a test: a port that leads to another one, until the cable is
// pulled. Then connections are still taken, and nothing passes, as behind a switch that is off.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <stdexcept>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

namespace plumb::testing {

class Cable {
 public:
  Cable() : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = Loopback(0);
    socklen_t size = sizeof(address);
    if (::bind(listener_, reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        ::listen(listener_, 16) != 0 ||
        ::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw std::runtime_error("no port for a cable");
    port_ = ntohs(address.sin_port);
    thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  }
  ~Cable() {
    thread_.request_stop();
    thread_.join();
    for (const auto& [a, b] : ends_) Close(a, b);
    ::close(listener_);
  }
  Cable(const Cable&) = delete;
  Cable& operator=(const Cable&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }
  void LeadTo(std::uint16_t port) { to_ = port; }
  void Pull() { is_pulled_ = true; }
  void Plug() { is_pulled_ = false; }

 private:
  static sockaddr_in Loopback(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }
  static void Close(int a, int b) {
    ::close(a);
    ::close(b);
  }

  void Run(const std::stop_token& stop) {
    constexpr int kLook_ms = 20;
    while (!stop.stop_requested()) {
      std::vector<pollfd> waits = {{.fd = listener_, .events = POLLIN, .revents = 0}};
      if (!is_pulled_) {
        for (const auto& [a, b] : ends_) {
          waits.push_back({.fd = a, .events = POLLIN, .revents = 0});
          waits.push_back({.fd = b, .events = POLLIN, .revents = 0});
        }
      }
      if (::poll(waits.data(), waits.size(), kLook_ms) <= 0 || is_pulled_) continue;
      for (std::size_t i = 1; i < waits.size(); i += 2) {
        const int a = waits[i].fd, b = waits[i + 1].fd;
        if ((waits[i].revents == 0 || Pass(a, b)) && (waits[i + 1].revents == 0 || Pass(b, a)))
          continue;
        Close(a, b);
        std::erase(ends_, std::pair(a, b));
      }
      if (waits[0].revents != 0) Connect();
    }
  }

  void Connect() {
    const int from = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    const int to = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in address = Loopback(to_);
    if (::connect(to, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0)
      ends_.emplace_back(from, to);
    else
      Close(from, to);
  }

  /// False once one side has ended.
  static bool Pass(int from, int to) {
    std::array<char, 65536> buffer{};
    const ssize_t count = ::recv(from, buffer.data(), buffer.size(), MSG_DONTWAIT);
    for (ssize_t sent = 0; sent < count;) {
      const ssize_t now =
          ::send(to, buffer.data() + sent, static_cast<std::size_t>(count - sent), MSG_NOSIGNAL);
      if (now <= 0) return false;
      sent += now;
    }
    return count > 0;
  }

  int listener_;
  std::uint16_t port_ = 0;
  std::atomic<std::uint16_t> to_ = 0;
  std::atomic<bool> is_pulled_ = false;
  std::vector<std::pair<int, int>> ends_;  ///< Of the thread.
  std::jthread thread_;
};

}  // namespace plumb::testing
