// SPDX-License-Identifier: Apache-2.0
// Asks the other units of the clinic whether the patient that is open here is open there, too.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/config/peers_settings.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"

namespace plumb {

/// Used on the loop's thread, which it never makes wait; each unit is asked by a thread of its own.
/// Nothing that a unit answers, or does not answer, stops a scan.
class PeerWatch {
 public:
  /// The loop is borrowed.
  /// @param secret  Of `settings.secret_file`; if empty, no unit is asked.
  /// @param changed  Called when notes() has changed. `found` is the new note that the patient is
  ///        open in another unit, or empty.
  PeerWatch(EventLoop& loop, const PeersSettings& settings, const std::string& secret,
            std::function<void(const Message& found)> changed,
            std::chrono::milliseconds ask_every = std::chrono::seconds(5));
  ~PeerWatch();
  PeerWatch(const PeerWatch&) = delete;
  PeerWatch& operator=(const PeerWatch&) = delete;

  [[nodiscard]] bool IsSetUp() const { return !peers_.empty(); }
  /// The session that is open here and its patient's code; both are empty if none is
  /// open, and then no unit is asked.
  void SetOpen(const std::string& session, const std::string& code);
  [[nodiscard]] const std::string& session() const { return session_; }
  /// Where the patient is open, too, and of which units that is not known.
  [[nodiscard]] std::vector<Message> notes() const;

 private:
  enum class Answer { kNone, kClosed, kOpen, kNotKnown };
  struct Peer {
    std::string url, name;
    Answer answer = Answer::kNone;
    bool was_open = false;  ///< By the last answer that was understood.
    std::jthread thread;
  };
  void AskAgain(const std::stop_token& stop, std::size_t peer, const std::string& url);
  [[nodiscard]] Answer Ask(const std::string& url, const std::string& code,
                           const std::stop_token& stop) const;
  void Note(std::size_t peer, int opening, Answer answer);

  EventLoop& loop_;
  const PeersSettings settings_;
  const std::string secret_;
  const std::function<void(const Message&)> changed_;
  const std::chrono::milliseconds ask_every_;
  std::string session_;
  mutable std::mutex mutex_;  ///< Of the next two.
  std::condition_variable_any opened_;
  std::string code_;
  int opening_ = 0;  ///< Counts the calls of SetOpen(): an answer to an earlier one counts nothing.
  std::function<void(std::size_t, int, Answer)> note_;
  std::vector<Peer> peers_;  // its threads use the members above
  AliveFlag alive_;
};

}  // namespace plumb
