// SPDX-License-Identifier: Apache-2.0
// The other side of a connection that the program under test makes: a server of one connection
// after the other, whose conversation is the test's, in the clear or behind TLS.
#pragma once

#include <arpa/inet.h>
#include <gnutls/gnutls.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "web/security/tls_identity.hpp"

namespace plumb::testing {

/// One connection, used by the server's thread.
class PeerConnection {
 public:
  explicit PeerConnection(int fd) : fd_(fd) {
    const timeval patience{.tv_sec = 20, .tv_usec = 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience));
    ::setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
  }
  ~PeerConnection() {
    if (session_ != nullptr) gnutls_deinit(session_);
    if (credentials_ != nullptr) gnutls_certificate_free_credentials(credentials_);
    ::close(fd_);
  }
  PeerConnection(const PeerConnection&) = delete;
  PeerConnection& operator=(const PeerConnection&) = delete;

  /// False if the client does not trust this identity.
  bool StartTls(const web::TlsIdentity& identity) {
    gnutls_certificate_allocate_credentials(&credentials_);
    const auto datum = [](const std::string& pem) {
      return gnutls_datum_t{.data = reinterpret_cast<unsigned char*>(const_cast<char*>(pem.data())),
                            .size = static_cast<unsigned>(pem.size())};
    };
    const gnutls_datum_t certificate = datum(identity.certificate_pem),
                         key = datum(identity.key_pem);
    gnutls_certificate_set_x509_key_mem(credentials_, &certificate, &key, GNUTLS_X509_FMT_PEM);
    gnutls_init(&session_, GNUTLS_SERVER);
    gnutls_set_default_priority(session_);
    gnutls_credentials_set(session_, GNUTLS_CRD_CERTIFICATE, credentials_);
    gnutls_transport_set_int(session_, fd_);
    int code = 0;
    do code = gnutls_handshake(session_);
    while (code < 0 && gnutls_error_is_fatal(code) == 0);
    return code == GNUTLS_E_SUCCESS;
  }

  /// False once the client has gone.
  bool Write(std::string_view text) const {
    while (!text.empty()) {
      const ssize_t sent = session_ != nullptr
                               ? gnutls_record_send(session_, text.data(), text.size())
                               : ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }
  /// Up to and with `end`; what came if the client ends before.
  std::string ReadTo(std::string_view end) {
    std::size_t found = std::string::npos;
    while ((found = received_.find(end)) == std::string::npos && ReadMore()) {
    }
    const std::size_t length = found == std::string::npos ? received_.size() : found + end.size();
    return Take(length);
  }
  std::string ReadBytes(std::size_t count) {
    while (received_.size() < count && ReadMore()) {
    }
    return Take(std::min(count, received_.size()));
  }

 private:
  bool ReadMore() {
    char buffer[4096];
    const ssize_t got = session_ != nullptr ? gnutls_record_recv(session_, buffer, sizeof(buffer))
                                            : ::recv(fd_, buffer, sizeof(buffer), 0);
    if (got > 0) received_.append(buffer, static_cast<std::size_t>(got));
    return got > 0;
  }
  std::string Take(std::size_t count) {
    std::string taken = received_.substr(0, count);
    received_.erase(0, count);
    return taken;
  }

  int fd_;
  gnutls_session_t session_ = nullptr;
  gnutls_certificate_credentials_t credentials_ = nullptr;
  std::string received_;
};

class FakePeer {
 public:
  /// @param talk  Called for each connection, on the server's thread.
  explicit FakePeer(std::function<void(PeerConnection&)> talk) : talk_(std::move(talk)) {
    fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof(address);
    ::bind(fd_, reinterpret_cast<sockaddr*>(&address), length);
    ::listen(fd_, 8);
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &length);
    port_ = ntohs(address.sin_port);
    thread_ = std::jthread([this](const std::stop_token& stop) { Serve(stop); });
  }
  ~FakePeer() {
    thread_.request_stop();
    thread_.join();
    ::close(fd_);
  }
  FakePeer(const FakePeer&) = delete;
  FakePeer& operator=(const FakePeer&) = delete;

  [[nodiscard]] std::uint16_t port() const { return port_; }

 private:
  void Serve(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      pollfd ready{.fd = fd_, .events = POLLIN, .revents = 0};
      if (::poll(&ready, 1, 20) <= 0) continue;
      PeerConnection connection(::accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC));
      talk_(connection);
    }
  }

  std::function<void(PeerConnection&)> talk_;
  int fd_ = -1;
  std::uint16_t port_ = 0;
  std::jthread thread_;
};

}  // namespace plumb::testing
