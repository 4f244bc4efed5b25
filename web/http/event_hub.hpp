// SPDX-License-Identifier: Apache-2.0
// The event stream (text/event-stream) to every open page.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <string_view>

#include "web/security/sessions.hpp"

namespace plumb::web {

/// One open stream: bytes wait in a bounded buffer until the connection takes them.
class EventStream {
 public:
  EventStream(std::shared_ptr<Session> session, std::size_t capacity)
      : session_(std::move(session)), capacity_(capacity) {}

  /// Wakes the connection; called when there is data, or when the stream has ended.
  std::function<void()> wake;
  /// Called when the viewer is too slow and its connection must be closed.
  std::function<void()> cut;

  /// At most `max` bytes, removed from the buffer.
  [[nodiscard]] std::string_view Peek(std::size_t max) const;
  void Take(std::size_t count);
  [[nodiscard]] bool empty() const { return taken_ == buffer_.size(); }
  [[nodiscard]] bool closed() const { return closed_; }
  [[nodiscard]] const Session& session() const { return *session_; }
  [[nodiscard]] std::size_t waiting() const { return buffer_.size() - taken_; }

  void Send(std::string_view text);
  /// Ends the stream after the waiting data.
  void Close();

 private:
  std::shared_ptr<Session> session_;
  std::size_t capacity_;
  std::string buffer_;
  std::size_t taken_ = 0;
  bool closed_ = false;
};

/// All streams. Used on the loop thread.
class EventHub {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  struct Limits {
    std::size_t all = 32, of_account = 16, of_session = 6;
    std::size_t buffer_bytes = 64 << 10;  ///< Buffer of one stream.
  };

  explicit EventHub(Limits limits) : limits_(limits) {}

  /// If one session or one account has too many, its oldest ends; if all together are too many, the
  /// oldest of the accounts with the most.
  [[nodiscard]] std::shared_ptr<EventStream> Open(std::shared_ptr<Session> session);
  void Remove(const std::shared_ptr<EventStream>& stream) { streams_.remove(stream); }
  /// To every stream. @param data  One line.
  void Broadcast(std::string_view event, std::string_view data);
  /// A comment to every stream, so that dead connections are noticed.
  void Beat();
  /// Ends the streams of sessions that are over, after notifying them. True if there was one.
  bool EndOver();
  void CloseAll();
  [[nodiscard]] std::size_t size() const { return streams_.size(); }

 private:
  Limits limits_;
  std::list<std::shared_ptr<EventStream>> streams_;
};

/// One event on the wire.
[[nodiscard]] std::string FormatEvent(std::string_view event, std::string_view data);

}  // namespace plumb::web
