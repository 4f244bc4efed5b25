// SPDX-License-Identifier: Apache-2.0
#include "drivers/stream/feeder_server.hpp"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/unix_socket.hpp"
#include "words/stream.hpp"

namespace plumb::stream {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t kMaxStamp_us = std::int64_t{1} << 53;
constexpr std::chrono::milliseconds kNextTry{100};

int Listen(const std::filesystem::path& socket) try {
  return ListenUnix(socket);
} catch (const IoError& error) {
  throw DeviceError(error.message());
}

void SendLine(int connection, const json& line) {
  const std::string text = line.dump(-1, ' ', true, json::error_handler_t::replace) + "\n";
  (void)::send(connection, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

}  // namespace

FeederServer::FeederServer(std::filesystem::path socket)
    : socket_(std::move(socket)),
      listening_(Listen(socket_)),
      wake_(::eventfd(0, EFD_CLOEXEC)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

FeederServer::~FeederServer() {
  thread_.request_stop();
  const std::uint64_t one = 1;
  (void)!::write(wake_.get(), &one, sizeof one);
  thread_.join();
  std::error_code ignored;
  std::filesystem::remove(socket_, ignored);
}

std::optional<Feeder> FeederServer::feeder() const {
  const std::lock_guard lock(mutex_);
  return feeder_;
}

bool FeederServer::Deliver(const std::string& uri, const std::shared_ptr<FrameBox>& box) {
  const std::lock_guard lock(mutex_);
  if (!feeder_ || feeder_->description.uri != uri) return false;
  box_ = box;
  events_.Watch(uri, box);
  return true;
}

void FeederServer::Tell(const json& line) {
  const std::lock_guard lock(mutex_);
  if (connection_ >= 0) SendLine(connection_, line);
}

void FeederServer::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::optional<std::chrono::milliseconds> longest;
    std::array<pollfd, 2> wait = {{{ListeningNow(longest), POLLIN, 0}, {wake_.get(), POLLIN, 0}}};
    const int timeout_ms = longest ? static_cast<int>(longest->count()) : -1;
    if (::poll(wait.data(), wait.size(), timeout_ms) < 0 || wait[0].revents == 0) continue;
    const Descriptor connection = Accept();
    if (connection.get() >= 0) Serve(connection.get());
  }
}

Descriptor FeederServer::Accept() {
  Descriptor connection(
      ::accept4(listening_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (connection.get() < 0) listen_again_ = Clock::now() + kNextTry;
  return connection;
}

int FeederServer::ListeningNow(std::optional<std::chrono::milliseconds>& wait) const {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(listen_again_ - Clock::now());
  if (left.count() <= 0) return listening_.get();
  wait = wait ? std::min(*wait, left) : left;
  return -1;
}

void FeederServer::Serve(int connection) {
  std::string uri;
  try {
    const Hello hello = ReadHello(connection);
    uri = "stream:" + std::to_string(++num_connected_);
    {
      const std::lock_guard lock(mutex_);
      const std::string name = hello.name.empty() ? hello.serial : hello.name;
      feeder_ = Feeder{{.uri = uri, .serial = hello.serial, .name = name}, hello};
      connection_ = connection;
      SendLine(connection, {{"accepted", true}});
    }
    events_.Notify();
    for (;;) ReadImage(connection, hello);
  } catch (const Gone&) {
  } catch (const DataError& error) {
    SendLine(connection, {{"refused", error.what()}});
  }
  if (uri.empty()) return;
  {
    const std::lock_guard lock(mutex_);
    feeder_.reset();
    box_.reset();
    connection_ = -1;
  }
  events_.Lose(uri);
  events_.Notify();
}

void FeederServer::ReadExactly(int connection, void* to, std::size_t size,
                               Clock::time_point until) {
  auto* next = static_cast<char*>(to);
  while (size > 0) {
    const ssize_t got = ::recv(connection, next, size, 0);
    if (got > 0) {
      next += got;
      size -= static_cast<std::size_t>(got);
      continue;
    }
    if (got == 0 || (errno != EAGAIN && errno != EINTR)) throw Gone();
    std::optional left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
    if (left->count() <= 0)
      throw DataError(say::stream::Stalled(static_cast<double>(kPatience.count())));
    std::array<pollfd, 3> wait = {
        {{connection, POLLIN, 0}, {wake_.get(), POLLIN, 0}, {ListeningNow(left), POLLIN, 0}}};
    (void)::poll(wait.data(), wait.size(), static_cast<int>(left->count()));
    if (wait[1].revents != 0) throw Gone();
    if (wait[2].revents != 0) RefuseSecond();
  }
}

void FeederServer::RefuseSecond() {
  const Descriptor second = Accept();
  if (second.get() >= 0) SendLine(second.get(), {{"refused", say::stream::OneFeeder().English()}});
}

Hello FeederServer::ReadHello(int connection) {
  const auto until = Clock::now() + kPatience;
  Header header;
  ReadExactly(connection, &header, sizeof header, until);
  if (KindOf(header) != Kind::kHello) throw DataError(say::stream::NoHello());
  if (header.size > kMaxHello)
    throw DataError(say::stream::HelloTooLong(static_cast<std::int64_t>(kMaxHello)));
  std::string text(static_cast<std::size_t>(header.size), ' ');
  ReadExactly(connection, text.data(), text.size(), until);
  return ParseHello(text);
}

void FeederServer::ReadImage(int connection, const Hello& hello) {
  const auto until = Clock::now() + kPatience;
  Header header;
  ReadExactly(connection, &header, sizeof header, until);
  const std::optional<Kind> kind = KindOf(header);
  if (kind != Kind::kColor && kind != Kind::kDepth) throw DataError(say::stream::NoImage());
  if (header.stamp_us < 0 || header.stamp_us > kMaxStamp_us) throw DataError(say::stream::Stamp());
  cv::Mat image = ImageFor(*kind, header.size, hello);
  ReadExactly(connection, image.data, static_cast<std::size_t>(header.size), until);
  std::shared_ptr<FrameBox> box;
  {
    const std::lock_guard lock(mutex_);
    box = box_.lock();
  }
  if (!box) return;
  const bool is_color = *kind == Kind::kColor;
  if (is_color && hello.is_bgr) cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
  box->Add(is_color ? StreamKind::kColor : StreamKind::kDepth, header.stamp_us, std::move(image));
}

}  // namespace plumb::stream
