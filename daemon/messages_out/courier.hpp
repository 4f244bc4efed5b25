// SPDX-License-Identifier: Apache-2.0
// Takes messages out by one way, on a thread of its own, so that nothing else waits for a network.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "daemon/messages_out/out_message.hpp"

namespace plumb {

/// When a message that was not taken is tried again; after the last pause it is given up.
using RetryPauses = std::vector<std::chrono::milliseconds>;

/// On destruction, what waits is given up.
class Courier {
 public:
  static constexpr std::size_t kMostWaiting = 16;
  struct Attempt {
    std::string id;
    std::string failure;  ///< Empty: the message was taken.
    bool is_given_up = false;
  };

  /// @param send  One attempt: why it failed, or empty. @param report  Called after each attempt;
  ///        both on this courier's thread.
  Courier(std::function<std::string(const OutMessage&, const std::stop_token&)> send,
          RetryPauses pauses, std::function<void(const Attempt&)> report);
  ~Courier();
  Courier(const Courier&) = delete;
  Courier& operator=(const Courier&) = delete;

  /// Does not wait. @param is_tried_once  It is given up after the first failure.
  /// @return False if too many wait already: it is not sent then.
  [[nodiscard]] bool Post(OutMessage message, bool is_tried_once);
  [[nodiscard]] std::size_t num_waiting() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    OutMessage message;
    bool is_tried_once = false;
    std::size_t failures = 0;
    Clock::time_point due;
  };

  void Run(const std::stop_token& stop);
  /// Waits until one is due. Its place in `waiting_`; the end at a stop.
  std::vector<Waiting>::iterator NextDue(std::unique_lock<std::mutex>& lock,
                                         const std::stop_token& stop);
  [[nodiscard]] std::string TrySend(const OutMessage& message, const std::stop_token& stop) const;

  const std::function<std::string(const OutMessage&, const std::stop_token&)> send_;
  const RetryPauses pauses_;
  const std::function<void(const Attempt&)> report_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::vector<Waiting> waiting_;
  std::size_t posted_ = 0;
  std::jthread thread_;  // last: it uses the members above
};

}  // namespace plumb
