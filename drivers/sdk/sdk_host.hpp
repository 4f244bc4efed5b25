// SPDX-License-Identifier: Apache-2.0
// A maker's library in use: what drivers of such libraries share of listing, opening, and telling
// what was plugged in or unplugged.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/live/frame_box.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/live/sensor_events.hpp"
#include "drivers/sdk/sdk_library.hpp"
#include "drivers/sdk/sdk_unit.hpp"

namespace plumb {

struct SdkAttached {
  SdkUnit unit;
  std::shared_ptr<const void> device;  ///< The library's handle, if it has one for each unit.
};

/// What a sensor is opened with. `watched` keeps the handle, and ends the watch on the unit.
struct SdkOpening {
  SdkAttached attached;
  SensorDescription description;
  std::shared_ptr<FrameBox> box;
  std::shared_ptr<const void> watched;
};

/// The context of a library. Open sensors keep it.
class SdkHost {
 public:
  /// @param scheme  Of the URIs: the name of the driver.
  explicit SdkHost(std::string scheme) : scheme_(std::move(scheme)) {}
  virtual ~SdkHost() = default;
  SdkHost(const SdkHost&) = delete;
  SdkHost& operator=(const SdkHost&) = delete;

  [[nodiscard]] virtual const SdkLibrary& library() const = 0;
  /// Those without a serial, or that cannot be asked, as while they start, are left out.
  [[nodiscard]] virtual std::vector<SdkAttached> Attached() = 0;
  [[nodiscard]] virtual std::unique_ptr<LiveSensor> Open(const std::shared_ptr<SdkHost>& self,
                                                         SdkOpening opening) = 0;

  [[nodiscard]] SensorDescription DescriptionOf(const SdkUnit& unit);
  /// Reports its unplugging to the box, until the result is released.
  [[nodiscard]] static std::shared_ptr<const void> Watch(const std::shared_ptr<SdkHost>& self,
                                                         const SdkAttached& attached,
                                                         const std::shared_ptr<FrameBox>& box);
  [[nodiscard]] SensorEvents& events() { return events_; }

 protected:
  struct Watched {
    std::string serial, uri;
    std::shared_ptr<const void> device;
  };
  /// Those of the open ones are unplugged; `is_gone` may call nothing that waits for the library's
  /// threads.
  void Lose(const std::function<bool(const Watched&)>& is_gone);

 private:
  const std::string scheme_;
  SensorEvents events_;
  std::mutex mutex_;
  std::uintptr_t next_watch_ = 0;
  std::map<std::uintptr_t, Watched> watched_;
  std::map<std::string, int> times_unplugged_;  ///< By serial.
};

/// Hosts by a number, which a library gets in place of a pointer, because its thread may call once
/// more after the end of the host.
template <typename Host>
class SdkCallbacks {
 public:
  explicit SdkCallbacks(Host& host) {
    const std::lock_guard lock(Mutex());
    static std::uintptr_t next = 1;
    number_ = next++;
    Hosts()[number_] = &host;
  }
  ~SdkCallbacks() {
    const std::lock_guard lock(Mutex());
    Hosts().erase(number_);
  }
  SdkCallbacks(const SdkCallbacks&) = delete;
  SdkCallbacks& operator=(const SdkCallbacks&) = delete;

  [[nodiscard]] void* key() const { return reinterpret_cast<void*>(number_); }
  /// The host does not end during the call. Nothing happens if it has ended.
  static void With(void* key, const std::function<void(Host&)>& call) {
    const std::lock_guard lock(Mutex());
    const auto found = Hosts().find(reinterpret_cast<std::uintptr_t>(key));
    if (found != Hosts().end()) call(*found->second);
  }

 private:
  static std::mutex& Mutex() {
    static std::mutex mutex;
    return mutex;
  }
  static std::map<std::uintptr_t, Host*>& Hosts() {
    static std::map<std::uintptr_t, Host*> hosts;
    return hosts;
  }

  std::uintptr_t number_ = 0;
};

using MakeSdkHost = std::function<std::shared_ptr<SdkHost>(const SensorSettings&)>;

/// Adds a driver of a maker's library. `plumb doctor` says what of it is on the USB bus, which
/// library was found, and of each camera whether it can be used.
void AddSdkDriver(SensorRegistry& registry, const std::string& name, const SdkTitle& title,
                  MakeSdkHost make);

}  // namespace plumb
