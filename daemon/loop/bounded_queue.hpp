// SPDX-License-Identifier: Apache-2.0
// A queue of limited length between two threads.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

namespace plumb {

/// First in, first out, at most `capacity` elements. Push() blocks when full (replay: every frame
/// counts); PushDroppingOldest() never blocks (live: the newest frame counts). All functions are
/// thread-safe.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity == 0 ? 1 : capacity) {}

  /// Waits for space. False (and the element is dropped) once the queue is closed or a stop is
  /// requested.
  bool Push(T element, const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return closed_ || elements_.size() < capacity_; });
    if (closed_ || stop.stop_requested()) return false;
    elements_.push_back(std::move(element));
    changed_.notify_all();
    return true;
  }

  /// Makes space by dropping the oldest elements; returns how many were dropped. A closed queue
  /// drops the new one.
  int PushDroppingOldest(T element) {
    const std::lock_guard lock(mutex_);
    if (closed_) return 1;
    int num_dropped = 0;
    for (; elements_.size() >= capacity_; ++num_dropped) elements_.pop_front();
    elements_.push_back(std::move(element));
    changed_.notify_all();
    return num_dropped;
  }

  /// False (and the element is dropped) if there is no space or the queue is closed. Never waits.
  bool TryPush(T element) {
    const std::lock_guard lock(mutex_);
    if (closed_ || elements_.size() >= capacity_) return false;
    elements_.push_back(std::move(element));
    changed_.notify_all();
    return true;
  }

  /// Waits for an element. Nothing once the queue is closed and empty, or a stop is requested.
  std::optional<T> Pop(const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return closed_ || !elements_.empty(); });
    if (elements_.empty() || stop.stop_requested()) return std::nullopt;
    T element = std::move(elements_.front());
    elements_.pop_front();
    changed_.notify_all();
    return element;
  }

  /// No further elements: Push() returns; Pop() returns the remaining elements and then nothing.
  void Close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 private:
  const std::size_t capacity_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<T> elements_;
  bool closed_ = false;
};

}  // namespace plumb
