// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/event_loop.hpp"

#include <signal.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <systemd/sd-event.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <deque>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

namespace plumb {
namespace {

int Checked(int result, const char* what) {
  if (result < 0)
    throw std::runtime_error(
        fmt::format("the event loop cannot {}: {}", what, std::strerror(-result)));
  return result;
}

void BlockSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  ::signal(SIGPIPE,
           SIG_IGN);  // a closed connection is an error of its write, not the end of the program
}

}  // namespace

struct EventLoop::Impl {
  sd_event* event = nullptr;
  int wake_fd = -1;
  sd_event_source* wake_source = nullptr;
  std::mutex mutex;
  struct Posted {
    const char* name;
    std::function<void()> call;
  };
  std::deque<Posted> posted;
  std::exception_ptr error;
  LoopMeter meter;

  /// Runs a callback inside sd-event's C code, through which exceptions must not pass.
  void Guard(const char* name, const std::function<void()>& call) noexcept {
    if constexpr (PLUMB_LOOP_METER) meter.Begin(name);
    try {
      call();
    } catch (...) {
      if (!error) error = std::current_exception();
      sd_event_exit(event, 1);
    }
    if constexpr (PLUMB_LOOP_METER) meter.End();
  }

  void RunPosted() {
    std::uint64_t count = 0;
    (void)!::read(wake_fd, &count, sizeof(count));
    std::deque<Posted> work;
    {
      const std::lock_guard lock(mutex);
      work.swap(posted);
    }
    while (!work.empty() && !error) {
      Guard(work.front().name, work.front().call);
      work.pop_front();
    }
  }

  static int OnWake(sd_event_source*, int, std::uint32_t, void* self) {
    static_cast<Impl*>(self)->RunPosted();
    return 0;
  }
};

struct EventLoop::Source::Impl {
  EventLoop::Impl* loop = nullptr;
  const char* name = "";
  sd_event_source* source = nullptr;
  std::shared_ptr<std::function<void(std::uint32_t)>>
      callback;  // shared, because the source may be destroyed by its own callback

  ~Impl() {
    if (source != nullptr) sd_event_source_disable_unref(source);
  }
  void Call(std::uint32_t events) {
    const std::shared_ptr<std::function<void(std::uint32_t)>> kept = callback;
    EventLoop::Impl* const its_loop = loop;
    its_loop->Guard(name, [&] { (*kept)(events); });
  }
  static int OnIo(sd_event_source*, int, std::uint32_t events, void* self) {
    static_cast<Impl*>(self)->Call(events);
    return 0;
  }
  static int OnTimer(sd_event_source*, std::uint64_t, void* self) {
    static_cast<Impl*>(self)->Call(0);
    return 0;
  }
  static int OnSignal(sd_event_source*, const signalfd_siginfo*, void* self) {
    static_cast<Impl*>(self)->Call(0);
    return 0;
  }
};

EventLoop::EventLoop() : impl_(std::make_unique<Impl>()) {
  BlockSignals();
  Checked(sd_event_new(&impl_->event), "start");
  impl_->wake_fd = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (impl_->wake_fd < 0) throw std::runtime_error("the event loop cannot make its eventfd");
  Checked(sd_event_add_io(impl_->event, &impl_->wake_source, impl_->wake_fd, EPOLLIN, Impl::OnWake,
                          impl_.get()),
          "watch its eventfd");
}

EventLoop::~EventLoop() {
  sd_event_source_disable_unref(impl_->wake_source);
  sd_event_unref(impl_->event);
  if (impl_->wake_fd >= 0) ::close(impl_->wake_fd);
}

int EventLoop::Run() {
  const int code = sd_event_loop(impl_->event);
  if (impl_->error) std::rethrow_exception(std::exchange(impl_->error, nullptr));
  return Checked(code, "run");
}

void EventLoop::Quit(int exit_code) {
  Post("quit", [this, exit_code] { sd_event_exit(impl_->event, exit_code); });
}

LoopMeter& EventLoop::meter() { return impl_->meter; }

void EventLoop::Post(const char* name, std::function<void()> work) {
  {
    const std::lock_guard lock(impl_->mutex);
    impl_->posted.push_back({name, std::move(work)});
  }
  const std::uint64_t one = 1;
  (void)!::write(impl_->wake_fd, &one, sizeof(one));  // fails only when it is readable anyway
}

EventLoop::Source EventLoop::WatchDescriptor(const char* name, int fd, std::uint32_t epoll_events,
                                             std::function<void(std::uint32_t)> ready) {
  auto source = std::make_unique<Source::Impl>();
  source->loop = impl_.get();
  source->name = name;
  source->callback = std::make_shared<std::function<void(std::uint32_t)>>(std::move(ready));
  Checked(sd_event_add_io(impl_->event, &source->source, fd, epoll_events, Source::Impl::OnIo,
                          source.get()),
          "watch a descriptor");
  return Source(std::move(source));
}

EventLoop::Source EventLoop::WatchSignal(int signal, std::function<void()> caught) {
  auto source = std::make_unique<Source::Impl>();
  source->loop = impl_.get();
  source->name = "signal";
  source->callback = std::make_shared<std::function<void(std::uint32_t)>>(
      [call = std::move(caught)](std::uint32_t) { call(); });
  Checked(sd_event_add_signal(impl_->event, &source->source, signal, Source::Impl::OnSignal,
                              source.get()),
          "watch a signal");
  return Source(std::move(source));
}

EventLoop::Source EventLoop::MakeTimer(const char* name, std::function<void()> expired) {
  auto source = std::make_unique<Source::Impl>();
  source->loop = impl_.get();
  source->name = name;
  source->callback = std::make_shared<std::function<void(std::uint32_t)>>(
      [call = std::move(expired)](std::uint32_t) { call(); });
  constexpr std::uint64_t kAccuracyUs = 1000;
  Checked(sd_event_add_time(impl_->event, &source->source, CLOCK_MONOTONIC, 0, kAccuracyUs,
                            Source::Impl::OnTimer, source.get()),
          "make a timer");
  Checked(sd_event_source_set_enabled(source->source, SD_EVENT_OFF), "make a timer");
  return Source(std::move(source));
}

EventLoop::Source::Source() = default;
EventLoop::Source::Source(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventLoop::Source::~Source() = default;
EventLoop::Source::Source(Source&&) noexcept = default;
EventLoop::Source& EventLoop::Source::operator=(Source&&) noexcept = default;

void EventLoop::Source::SetEvents(std::uint32_t epoll_events) {
  Checked(sd_event_source_set_io_events(impl_->source, epoll_events), "change what it watches");
}

void EventLoop::Source::ArmAt(Clock::time_point time) {
  const auto us =
      std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
  Checked(sd_event_source_set_time(impl_->source,
                                   static_cast<std::uint64_t>(std::max<std::int64_t>(us, 0))),
          "arm a timer");
  Checked(sd_event_source_set_enabled(impl_->source, SD_EVENT_ONESHOT), "arm a timer");
}

void EventLoop::Source::ArmAfter(std::chrono::microseconds delay) { ArmAt(Clock::now() + delay); }

void EventLoop::Source::ArmAfterSeconds(double seconds) {
  ArmAfter(std::chrono::microseconds(static_cast<std::int64_t>(seconds * 1e6)));
}

void EventLoop::Source::Disarm() {
  Checked(sd_event_source_set_enabled(impl_->source, SD_EVENT_OFF), "disarm a timer");
}

bool EventLoop::Source::is_armed() const {
  int enabled = 0;
  return impl_ && sd_event_source_get_enabled(impl_->source, &enabled) >= 0 &&
         enabled != SD_EVENT_OFF;
}

}  // namespace plumb
