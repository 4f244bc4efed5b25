// SPDX-License-Identifier: Apache-2.0
// The end of the process must not wait forever for a thread that does not return, such as a sensor
// driver that hangs.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

namespace plumb {

/// Calls `give_up` once, on its own thread, if it is not destroyed in time.
class EndGuard {
 public:
  EndGuard(std::chrono::milliseconds longest, std::function<void()> give_up)
      : give_up_(std::move(give_up)),
        thread_([this, longest](const std::stop_token& stop) { Run(stop, longest); }) {}
  EndGuard(const EndGuard&) = delete;
  EndGuard& operator=(const EndGuard&) = delete;

 private:
  void Run(const std::stop_token& stop, std::chrono::milliseconds longest) {
    std::unique_lock lock(mutex_);
    destroyed_.wait_for(lock, stop, longest, [] { return false; });
    if (!stop.stop_requested()) give_up_();
  }

  const std::function<void()> give_up_;
  std::mutex mutex_;
  std::condition_variable_any destroyed_;
  std::jthread thread_;  // last: starts when the members above are initialised
};

}  // namespace plumb
