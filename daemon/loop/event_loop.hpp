// The event loop of the main thread (sd-event): descriptors, timers, signals, and calls posted by
// other threads.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>

#include "daemon/loop/loop_meter.hpp"

namespace plumb {

/// Everything but Post() and Quit() belongs to the thread that made the loop, and all callbacks run
/// on it. A callback that throws ends Run(), which throws it on. Construct it before any other
/// thread starts: it blocks the signals that it watches, and threads inherit that. What watches or
/// is posted has a name, for the meter: a text of the program.
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

  /// Ends Run() after the callback that runs now. Thread-safe.
  void Quit(int exit_code);

  /// Has the loop call `work`, in the order of posting. Thread-safe, never waits. What is posted
  /// after Run() ended is dropped.
  void Post(const char* name, std::function<void()> work);

  /// Calls `ready` with the epoll events that came, for as long as the source lives. The descriptor
  /// stays the caller's.
  [[nodiscard]] Source WatchDescriptor(const char* name, int fd, std::uint32_t epoll_events,
                                       std::function<void(std::uint32_t)> ready);

  /// Calls `caught` for a signal. One of SIGTERM, SIGINT, SIGHUP.
  [[nodiscard]] Source WatchSignal(int signal, std::function<void()> caught);

  /// A timer on the monotonic clock, not armed yet.
  [[nodiscard]] Source MakeTimer(const char* name, std::function<void()> expired);

  /// The cost of the callbacks so far: each callback and each posted call is a turn.
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

  /// For a descriptor: which epoll events to wait for.
  void SetEvents(std::uint32_t epoll_events);
  /// For a timer: expire once, at this time or after this long; an older arming is replaced.
  void ArmAt(Clock::time_point time);
  void ArmAfter(std::chrono::microseconds delay);
  void Disarm();
  [[nodiscard]] bool is_armed() const;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
