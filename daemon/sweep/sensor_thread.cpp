// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/sensor_thread.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/sweep/explain.hpp"
#include "daemon/sweep/second_sensor.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "words/scan.hpp"

namespace plumb {

using Clock = std::chrono::steady_clock;

namespace {
constexpr std::chrono::seconds kListAgain{2};
}

/// All members are used by the sensor thread only, except atomics and those guarded by the mutex.
struct SensorThread::Impl {
  Impl(std::function<std::unique_ptr<SensorProvider>()> make, SensorThreadOptions its_options,
       std::function<void(const SensorEvent&)> listener)
      : make_provider(std::move(make)),
        options(std::move(its_options)),
        notify(std::move(listener)),
        retry(options.first_retry) {
    thread = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  }
  ~Impl() {
    thread.request_stop();
    {
      const std::lock_guard lock(mutex);
      if (sensor) sensor->Interrupt();
    }
    thread.join();
  }

  const std::function<std::unique_ptr<SensorProvider>()> make_provider;
  const SensorThreadOptions options;
  const std::function<void(const SensorEvent&)> notify;

  mutable std::mutex mutex;
  std::condition_variable_any changed;
  bool bus_changed = true;             // guarded: set by the provider's listener
  std::shared_ptr<LiveFeed> wanted;    // guarded: destination requested for the frames
  std::atomic<bool> is_sweep = true;   // of `wanted`
  std::shared_ptr<LiveSensor> sensor;  // guarded for others: written by the sensor thread only
  SensorSnapshot current;              // guarded
  std::optional<Frame> newest;         // guarded
  std::atomic<double> heartbeat = SteadySeconds();

  std::unique_ptr<SensorProvider> provider;
  SecondSensor second{options.second_serial};
  std::shared_ptr<LiveFeed> feed;  // destination of the frames
  std::weak_ptr<LiveFeed>
      spoiled;         // its sensor was unplugged: frames of the next one do not belong to it
  bool ready = false;  // kReady was reported for this sensor
  std::optional<SensorEvent::Kind> reported;
  Message reported_reason;
  std::chrono::milliseconds retry;
  std::optional<Clock::time_point> retry_at;
  Clock::time_point listed_at;
  std::jthread thread;  // last: starts when the members above are initialised

  void Run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      heartbeat = SteadySeconds();
      try {
        if (!provider) MakeProvider();
        TendSecond();
        if (!sensor) Find();
        // The destructor asks to stop before it looks for a sensor to interrupt: one that has been
        // opened since then would wait for a frame for good.
        if (stop.stop_requested()) break;
        if (sensor) {
          Read(stop);
        } else {
          Wait(stop);
        }
      } catch (const DeviceLost&) {
        Drop();
        {
          const std::lock_guard lock(mutex);
          bus_changed = true;  // another one may be attached already
        }
        NotifyOnce(SensorEvent::Kind::kLost, {});
      } catch (const std::exception& error) {
        Drop();
        NotifyOnce(SensorEvent::Kind::kFailed, Explain(error));
        retry_at = Clock::now() + retry;
        retry = std::min(2 * retry, options.last_retry);
      }
    }
    Drop();
    second.Close();
    provider.reset();
  }

  void TendSecond() {
    std::shared_ptr<LiveFeed> to;
    {
      const std::lock_guard lock(mutex);
      if (!is_sweep) to = wanted;
    }
    second.Tend(provider.get(), to);
  }

  void MakeProvider() {
    if (retry_at && Clock::now() < *retry_at) return;
    provider = make_provider();
    provider->SetListener([this] {
      const std::lock_guard lock(mutex);
      bus_changed = true;
      changed.notify_all();
    });
  }

  /// Opens a sensor if one is attached and it is time; reports if there is none.
  void Find() {
    if (!provider) return;
    {
      const std::lock_guard lock(mutex);
      // The bus is also checked without a notification: a plug event that the driver missed must
      // not require a restart.
      const bool due = Clock::now() >= (retry_at ? *retry_at : listed_at + kListAgain);
      if (!bus_changed && !due) return;
      bus_changed = false;
      listed_at = Clock::now();
    }
    const std::vector<SensorDescription> attached = provider->List();
    const auto match =
        std::find_if(attached.begin(), attached.end(), [&](const SensorDescription& sensor_there) {
          return options.serial.empty() || sensor_there.serial == options.serial;
        });
    if (match == attached.end()) {
      retry_at.reset();
      retry = options.first_retry;
      const auto wrong = std::ranges::find_if(
          attached, [&](const SensorDescription& one) { return one.serial != second.serial(); });
      if (wrong == attached.end() || options.serial.empty()) {
        NotifyOnce(SensorEvent::Kind::kLost, {});
      } else {
        NotifyOnce(SensorEvent::Kind::kFailed,
                   say::scan::WrongSensor(options.serial, wrong->serial));
      }
      return;
    }
    retry_at.reset();
    std::shared_ptr<LiveSensor> opened = OpenSensor(*provider, match->serial);
    const std::lock_guard lock(mutex);
    sensor = std::move(opened);
    ready = false;
    current = {.present = false,
               .sensor = sensor->description(),
               .statistics = {},
               .info = sensor->info(),
               .others = Others(attached, sensor->description())};
  }

  [[nodiscard]] std::vector<std::string> Others(const std::vector<SensorDescription>& attached,
                                                const SensorDescription& used) const {
    std::vector<std::string> others;
    for (const SensorDescription& one : attached) {
      if (one.uri != used.uri && one.serial != second.serial()) others.push_back(one.serial);
    }
    return others;
  }

  /// Lists other units. Asking a new unit for its serial takes time, so not while a scan runs.
  void LookForOthers() {
    {
      const std::lock_guard lock(mutex);
      if (feed || !ready || !std::exchange(bus_changed, false)) return;
    }
    const std::vector<SensorDescription> attached = provider->List();
    std::vector<std::string> others = Others(attached, sensor->description());
    // the one in use was unplugged: Next() will report it
    if (std::ranges::find(attached, sensor->description().uri, &SensorDescription::uri) ==
        attached.end())
      return;
    {
      const std::lock_guard lock(mutex);
      if (others == current.others) return;
      current.others = std::move(others);
    }
    Notify(SensorEvent::Kind::kOthers, {});
  }

  void Wait(const std::stop_token& stop) {
    std::unique_lock lock(mutex);
    const Clock::time_point heartbeat_due = Clock::now() + std::chrono::milliseconds(500);
    const Clock::time_point until = retry_at ? std::min(*retry_at, heartbeat_due) : heartbeat_due;
    // Without a provider nothing watches the bus, so notifications would never be handled: only the
    // next attempt is waited for.
    changed.wait_until(lock, stop, until, [this] { return provider != nullptr && bus_changed; });
  }

  void Read(const std::stop_token& stop) {
    SwitchFeed();
    LookForOthers();
    std::optional<Frame> frame;
    try {
      frame = sensor->Next();
    } catch (const ProcessStalled& error) {
      FailFeed(MessageOf(error));
      return;
    }
    if (!frame) {
      if (!stop.stop_requested()) throw DeviceError(say::scan::StreamEnded());
      return;
    }
    heartbeat = SteadySeconds();
    bool is_new = false;
    {
      const std::lock_guard lock(mutex);
      current.present = true;
      current.statistics = sensor->statistics();
      newest = *frame;
      if (WantedFeed() != feed) return;  // a scan began or ended while this frame was in transit
      is_new = !std::exchange(ready, true);
    }
    if (feed) feed->Push(std::move(*frame));
    if (is_new) {
      retry = options.first_retry;
      NotifyOnce(SensorEvent::Kind::kReady, {});
    }
  }

  /// Requires the lock.
  [[nodiscard]] std::shared_ptr<LiveFeed> WantedFeed() const {
    return wanted && wanted == spoiled.lock() ? nullptr : wanted;
  }

  void SwitchFeed() {
    std::shared_ptr<LiveFeed> next;
    {
      const std::lock_guard lock(mutex);
      next = WantedFeed();
    }
    if (next == feed) return;
    feed = next;
    sensor->LockExposure(feed != nullptr);
    if (!feed) return;
    if (options.before_scan && is_sweep) options.before_scan();
    sensor->Flush();
  }

  /// The sweep has a gap, but the sensor can still be read.
  void FailFeed(const Message& why) {
    if (feed) {
      feed->Fail(say::scan::ScanAgain(why));
      spoiled = std::exchange(feed, nullptr);
      sensor->LockExposure(false);
    }
    Notify(SensorEvent::Kind::kStalled, why);
  }

  void Drop() {
    const std::shared_ptr<LiveFeed> left = std::exchange(feed, nullptr);
    if (left && (is_sweep || options.second_serial.empty())) spoiled = left;
    std::shared_ptr<LiveSensor> gone;
    const std::lock_guard lock(mutex);
    gone = std::move(sensor);
    current.present = false;
    newest.reset();
  }

  void NotifyOnce(SensorEvent::Kind kind, const Message& reason) {
    if (reported == kind && reported_reason == reason && kind != SensorEvent::Kind::kReady) return;
    reported = kind;
    reported_reason = reason;
    if (kind == SensorEvent::Kind::kLost) {
      const std::lock_guard lock(mutex);
      current = {};
    }
    Notify(kind, reason);
  }

  void Notify(SensorEvent::Kind kind, const Message& reason) {
    SensorEvent event{.kind = kind, .sensor = {}, .reason = reason, .others = {}};
    {
      const std::lock_guard lock(mutex);
      event.sensor = current.sensor;
      event.others = current.others;
    }
    notify(event);
  }
};

SensorThread::SensorThread(std::function<std::unique_ptr<SensorProvider>()> make_provider,
                           SensorThreadOptions options,
                           std::function<void(const SensorEvent&)> notify)
    : impl_(std::make_unique<Impl>(std::move(make_provider), std::move(options),
                                   std::move(notify))) {}

SensorThread::~SensorThread() = default;

void SensorThread::BeginScan(std::shared_ptr<LiveFeed> feed, bool is_sweep) {
  const std::lock_guard lock(impl_->mutex);
  impl_->is_sweep = is_sweep;
  impl_->wanted = std::move(feed);
}

void SensorThread::EndScan() {
  std::shared_ptr<LiveFeed> feed;
  {
    const std::lock_guard lock(impl_->mutex);
    feed = std::exchange(impl_->wanted, nullptr);
  }
  if (feed) feed->Close();
}

std::optional<StreamInfo> SensorThread::AwaitSecond(const std::shared_ptr<LiveFeed>& feed,
                                                    std::chrono::milliseconds patience,
                                                    const std::stop_token& stop) const {
  return impl_->second.AwaitInfo(feed, patience, stop);
}

SensorSnapshot SensorThread::snapshot() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->current;
}

std::optional<Frame> SensorThread::latest() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->newest;
}

double SensorThread::heartbeat_s() const { return impl_->heartbeat; }

}  // namespace plumb
