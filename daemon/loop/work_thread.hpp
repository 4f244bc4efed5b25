// SPDX-License-Identifier: Apache-2.0
// A thread for work that may wait for a disk or a device and therefore does not belong on the loop.
// Executes it in order.
#pragma once

#include <functional>
#include <stop_token>
#include <thread>
#include <utility>

#include "daemon/loop/bounded_queue.hpp"

namespace plumb {

/// On destruction, it finishes the posted work. Work must not throw.
class WorkThread {
 public:
  explicit WorkThread(std::size_t capacity) : queue_(capacity), thread_([this] { Run(); }) {}
  ~WorkThread() { queue_.Close(); }
  WorkThread(const WorkThread&) = delete;
  WorkThread& operator=(const WorkThread&) = delete;

  /// False, without doing the work, if too much is queued already. Thread-safe, does not wait.
  [[nodiscard]] bool Post(std::function<void()> work) { return queue_.TryPush(std::move(work)); }

 private:
  void Run() {
    while (const std::optional<std::function<void()>> work = queue_.Pop()) (*work)();
  }

  BoundedQueue<std::function<void()>> queue_;
  std::jthread thread_;
};

}  // namespace plumb
