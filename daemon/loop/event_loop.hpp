// SPDX-License-Identifier: Apache-2.0
// The event loop of the main thread (sd-event): descriptors, timers, signals, and calls posted by
// other threads.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/loop/loop_meter.hpp"

namespace plumb {

/// Everything except Post() and Quit() must be called on the thread that created the loop, and all
/// callbacks run on it. A callback that throws ends Run(), which rethrows. Construct it before any
/// other thread starts: it blocks the signals that it watches, and threads inherit that. Each watch
/// and each posted call has a name for the meter, a string literal.
class EventLoop {
 public:
  using Clock = std::chrono::steady_clock;
  struct Impl;
  class Source;

  EventLoop();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  /// Runs until Quit(); returns its code.
  int Run();

  /// Ends Run() after the current callback. Thread-safe.
  void Quit(int exit_code);

  /// Posts `work` to the loop, in the order of the calls. Thread-safe, never waits. Calls posted
  /// after Run() has ended are dropped.
  void Post(const char* name, std::function<void()> work);

  /// Calls `ready` with the epoll events, during the lifetime of the source. The caller keeps the
  /// descriptor.
  [[nodiscard]] Source WatchDescriptor(const char* name, int fd, std::uint32_t epoll_events,
                                       std::function<void(std::uint32_t)> ready);

  /// Calls `caught` for a signal. One of SIGTERM, SIGINT, SIGHUP.
  [[nodiscard]] Source WatchSignal(int signal, std::function<void()> caught);

  /// A timer on the monotonic clock, not armed yet.
  [[nodiscard]] Source MakeTimer(const char* name, std::function<void()> expired);

  /// Cost of the callbacks so far; each callback and each posted call is a turn.
  /// It measures in developers' builds (PLUMB_LOOP_METER).
  [[nodiscard]] LoopMeter& meter();

 private:
  std::unique_ptr<Impl> impl_;
};

/// A watch of the loop; destroying it ends the watch, even from within its own callback.
class EventLoop::Source {
 public:
  struct Impl;
  Source();
  explicit Source(std::unique_ptr<Impl> impl);
  ~Source();
  Source(Source&&) noexcept;
  Source& operator=(Source&&) noexcept;

  /// For a descriptor: the epoll events to wait for.
  void SetEvents(std::uint32_t epoll_events);
  /// For a timer: expires once, at this time or after this duration; replaces an earlier arming.
  void ArmAt(Clock::time_point time);
  void ArmAfter(std::chrono::microseconds delay);
  void ArmAfterSeconds(double seconds);
  void Disarm();
  [[nodiscard]] bool is_armed() const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
