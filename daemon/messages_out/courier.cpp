// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/courier.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace plumb {

Courier::Courier(std::function<std::string(const OutMessage&, const std::stop_token&)> send,
                 RetryPauses pauses, std::function<void(const Attempt&)> report)
    : send_(std::move(send)),
      pauses_(std::move(pauses)),
      report_(std::move(report)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

Courier::~Courier() = default;

bool Courier::Post(OutMessage message, bool is_tried_once) {
  const std::lock_guard lock(mutex_);
  if (waiting_.size() >= kMostWaiting) return false;
  waiting_.push_back({.message = std::move(message),
                      .is_tried_once = is_tried_once,
                      .failures = 0,
                      .due = Clock::now()});
  ++posted_;
  changed_.notify_all();
  return true;
}

std::size_t Courier::num_waiting() const {
  const std::lock_guard lock(mutex_);
  return waiting_.size();
}

std::vector<Courier::Waiting>::iterator Courier::NextDue(std::unique_lock<std::mutex>& lock,
                                                         const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto next = std::ranges::min_element(waiting_, {}, &Waiting::due);
    if (next == waiting_.end()) {
      changed_.wait(lock, stop, [this] { return !waiting_.empty(); });
    } else if (Clock::now() >= next->due) {
      return next;
    } else {
      changed_.wait_until(lock, stop, next->due,
                          [this, seen = posted_] { return posted_ != seen; });
    }
  }
  return waiting_.end();
}

std::string Courier::TrySend(const OutMessage& message, const std::stop_token& stop) const {
  try {
    return send_(message, stop);
  } catch (const std::exception& error) {
    return error.what();  // a secret that cannot be read
  }
}

void Courier::Run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  for (;;) {
    const auto next = NextDue(lock, stop);
    if (next == waiting_.end()) return;
    Waiting one = std::move(*next);
    waiting_.erase(next);
    lock.unlock();
    Attempt attempt{.id = one.message.id, .failure = TrySend(one.message, stop)};
    if (stop.stop_requested()) return;
    const std::size_t failures = one.failures + (attempt.failure.empty() ? 0 : 1);
    attempt.is_given_up = failures > 0 && (one.is_tried_once || failures > pauses_.size());
    lock.lock();
    if (failures > one.failures && !attempt.is_given_up) {
      one.due = Clock::now() + pauses_[failures - 1];
      one.failures = failures;
      waiting_.push_back(std::move(one));
    }
    lock.unlock();
    report_(attempt);
    lock.lock();
  }
}

}  // namespace plumb
