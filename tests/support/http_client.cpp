// SPDX-License-Identifier: Apache-2.0
#include "tests/support/http_client.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <vector>

#include "algo/base/ascii_lower.hpp"
#include "tests/support/sanitized.hpp"

namespace plumb::test {
namespace {

constexpr int kLimit_ms = 30000 * testing::kSlowness;

sockaddr_in Address(const std::string& text, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  inet_pton(AF_INET, text.c_str(), &address.sin_addr);
  return address;
}

HttpAnswer ParseHead(const std::string& head) {
  HttpAnswer answer;
  answer.status = std::stoi(head.substr(9, 3));
  std::size_t at = head.find("\r\n") + 2;
  while (at < head.size()) {
    const std::size_t end = head.find("\r\n", at), colon = head.find(": ", at);
    if (end == std::string::npos || end == at) break;
    if (colon < end)
      answer.headers.emplace(AsciiLower(head.substr(at, colon - at)),
                             head.substr(colon + 2, end - colon - 2));
    at = end + 2;
  }
  return answer;
}

}  // namespace

std::string HttpAnswer::Header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? "" : found->second;
}

HttpConnection::HttpConnection(std::uint16_t port, const std::string& from)
    : fd_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  if (!from.empty()) {
    const sockaddr_in own = Address(from, 0);
    if (bind(fd_, reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0)
      throw std::runtime_error("cannot come from " + from);
  }
  const sockaddr_in address = Address("127.0.0.1", port);
  if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    close(fd_);
    throw std::runtime_error(std::string("cannot connect: ") + std::strerror(errno));
  }
}

HttpConnection::~HttpConnection() {
  if (fd_ >= 0) close(fd_);
}

HttpConnection::HttpConnection(HttpConnection&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), received_(std::move(other.received_)) {}

void HttpConnection::SetReceiveBuffer(int bytes) const {
  setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &bytes, sizeof bytes);
}

bool HttpConnection::Send(const std::string& bytes) {
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const ssize_t count = send(fd_, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (count <= 0) return false;
    sent += static_cast<std::size_t>(count);
  }
  return true;
}

bool HttpConnection::Fill() {
  pollfd waiting{fd_, POLLIN, 0};
  if (poll(&waiting, 1, kLimit_ms) != 1)
    throw std::runtime_error("no answer within the time limit");
  std::array<char, 65536> buffer{};
  const ssize_t count = recv(fd_, buffer.data(), buffer.size(), 0);
  if (count <= 0) return false;
  received_.append(buffer.data(), static_cast<std::size_t>(count));
  return true;
}

HttpAnswer HttpConnection::Read(bool head_only) {
  while (received_.find("\r\n\r\n") == std::string::npos) {
    if (!Fill()) return {};
  }
  const std::size_t end = received_.find("\r\n\r\n") + 4;
  HttpAnswer answer = ParseHead(received_.substr(0, end));
  received_.erase(0, end);
  // A stream of events never ends.
  if (answer.Header("transfer-encoding") == "chunked" && !head_only &&
      !answer.Header("content-type").starts_with("text/event-stream")) {
    answer.body = ReadChunks();
    return answer;
  }
  const std::string length = answer.Header("content-length");
  const std::size_t size = length.empty() || head_only ? 0 : std::stoul(length);
  while (received_.size() < size) {
    if (!Fill()) return {};
  }
  answer.body = received_.substr(0, size);
  received_.erase(0, size);
  return answer;
}

std::string HttpConnection::ReadChunks() {
  std::string body;
  for (;;) {
    const std::size_t size = std::stoul(ReadUntil("\r\n"), nullptr, 16);
    while (received_.size() < size + 2)
      if (!Fill()) return {};
    body += received_.substr(0, size);
    received_.erase(0, size + 2);
    if (size == 0) return body;
  }
}

std::string HttpConnection::ReadUntil(const std::string& text) {
  while (received_.find(text) == std::string::npos) {
    if (!Fill()) return {};
  }
  const std::size_t end = received_.find(text) + text.size();
  std::string found = received_.substr(0, end);
  received_.erase(0, end);
  return found;
}

bool HttpConnection::IsClosedBySoon() {
  try {
    while (Fill()) {
    }
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

HttpAnswer HttpClient::Ask(const std::string& method, const std::string& path,
                           const std::string& body) {
  std::string text = fmt::format("{} {} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\n",
                                 method, path, port_);
  std::string cookies = cookie;
  for (const auto& [name, value] : device_cookies)
    cookies += fmt::format("{}{}={}", cookies.empty() ? "" : "; ", name, value);
  if (!cookies.empty()) text += fmt::format("Cookie: {}\r\n", cookies);
  if (!csrf_token.empty()) text += fmt::format("X-CSRF-Token: {}\r\n", csrf_token);
  if (!body.empty() && !extra_headers.contains("Content-Type"))
    text += "Content-Type: application/json\r\n";
  for (const auto& [name, value] : extra_headers) text += fmt::format("{}: {}\r\n", name, value);
  if (method != "GET") text += fmt::format("Content-Length: {}\r\n", body.size());
  HttpConnection connection(port_);
  connection.Send(text + "\r\n" + body);
  HttpAnswer answer = connection.Read(method == "HEAD");
  const auto [begin, end] = answer.headers.equal_range("set-cookie");
  for (auto header = begin; header != end; ++header) {
    const std::string set = header->second.substr(0, header->second.find(';'));
    if (set.find("plumb_device_") == std::string::npos) {
      cookie = set;
    } else {
      device_cookies[set.substr(0, set.find('='))] = set.substr(set.find('=') + 1);
    }
  }
  return answer;
}

int HttpClient::LogIn(const std::string& name, const std::string& password) {
  const HttpAnswer answer = Post("/api/v1/login", {{"name", name}, {"password", password}});
  if (answer.status == 200) FetchToken();
  return answer.status;
}

bool AddAccount(std::uint16_t port, HttpClient& engineer, const std::string& name,
                const std::string& role) {
  const int added = engineer
                        .Post("/api/v1/users", {{"name", name},
                                                {"role", role},
                                                {"password", kFirstPassword},
                                                {"own_password", kPassword}})
                        .status;
  HttpClient person(port);
  return added == 201 && person.LogIn(name, kFirstPassword) == 200 &&
         person.Post("/api/v1/session/password",
                     {{"old_password", kFirstPassword}, {"password", kPassword}})
                 .status == 200;
}

void HttpClient::FetchToken() {
  csrf_token = Get("/api/v1/session").json().value("csrf_token", "");
}

struct ServingLoop::Shared {
  std::mutex mutex;
  std::condition_variable done;
  std::vector<std::function<void()>> work;
  int wake_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  ~Shared() { close(wake_fd); }
  void Wake() const {
    const std::uint64_t one = 1;
    [[maybe_unused]] const auto written = write(wake_fd, &one, sizeof one);
  }
};

ServingLoop::ServingLoop(web::HttpServer& server, std::function<void()> each_turn)
    : server_(server), each_turn_(std::move(each_turn)), shared_(std::make_shared<Shared>()) {
  thread_ = std::jthread([this](const std::stop_token& stop) { Serve(stop); });
}

ServingLoop::~ServingLoop() {
  thread_.request_stop();
  shared_->Wake();
}

void ServingLoop::Serve(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto wait = server_.timeout();
    std::array<pollfd, 2> waiting = {pollfd{server_.fd(), POLLIN, 0},
                                     pollfd{shared_->wake_fd, POLLIN, 0}};
    const int limit_ms =
        wait ? static_cast<int>(std::min<std::int64_t>(wait->count(), 1000)) : 1000;
    poll(waiting.data(), waiting.size(), each_turn_ ? std::min(limit_ms, 20) : limit_ms);
    std::uint64_t count = 0;
    [[maybe_unused]] const auto drained = read(shared_->wake_fd, &count, sizeof count);
    {
      const std::lock_guard lock(shared_->mutex);
      for (const auto& work : shared_->work) work();
      shared_->work.clear();
      shared_->done.notify_all();
    }
    if (each_turn_) each_turn_();
    server_.Run();
  }
}

void ServingLoop::Do(const std::function<void()>& work) {
  std::unique_lock lock(shared_->mutex);
  bool finished = false;
  shared_->work.push_back([&] {
    work();
    finished = true;
  });
  shared_->Wake();
  shared_->done.wait(lock, [&] { return finished; });
}

}  // namespace plumb::test
