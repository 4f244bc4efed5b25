// SPDX-License-Identifier: Apache-2.0
// What fake libraries of makers share: ports with cameras, whose images go to who started their
// streams. One set of ports for each type of camera, so that two libraries in one program are two.
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace plumb::testing {

/// @tparam Camera  With its `serial`.
/// @tparam FrameArrived, DevicesChanged  The library's calls.
/// @tparam DeviceList  Its list of devices, with `ports`.
template <typename Camera, typename FrameArrived, typename DevicesChanged, typename DeviceList>
struct FakePorts {
  /// Counts the objects that the library has given out.
  struct Counted {
    Counted() { ++num_alive; }
    ~Counted() { --num_alive; }
    Counted(const Counted&) = delete;
    Counted& operator=(const Counted&) = delete;
  };
  struct Started {
    FrameArrived call = nullptr;
    void* user = nullptr;
  };
  struct Port {
    Camera camera;
    bool is_gone = false, is_open = false;
    std::map<int, Started> started;                 ///< By stream.
    std::map<std::pair<int, int>, float> settings;  ///< By sensor and setting.
    int num_delivering = 0;
  };
  using Ports = std::vector<std::shared_ptr<Port>>;

  inline static std::atomic<int> num_alive = 0;
  inline static std::mutex mutex;
  inline static std::condition_variable changed;
  inline static Ports plugged;
  inline static DevicesChanged listener = nullptr;
  inline static void* listener_user = nullptr;

  /// With the mutex locked.
  static std::shared_ptr<Port> Find(const std::string& serial) {
    const auto found =
        std::ranges::find(plugged, serial, [](const auto& port) { return port->camera.serial; });
    return found == plugged.end() ? nullptr : *found;
  }
  static Ports All() {
    const std::lock_guard lock(mutex);
    return plugged;
  }
  static void Listen(DevicesChanged call, void* user) {
    const std::lock_guard lock(mutex);
    listener = call;
    listener_user = user;
  }
  static void Attach(Camera camera) {
    auto added = std::make_shared<Port>();
    added->camera = std::move(camera);
    {
      const std::lock_guard lock(mutex);
      plugged.push_back(added);
    }
    Tell({}, {added});
  }
  static void Detach(const std::string& serial) {
    std::shared_ptr<Port> removed;
    {
      const std::lock_guard lock(mutex);
      removed = Find(serial);
      if (!removed) return;
      removed->is_gone = true;
      std::erase(plugged, removed);
    }
    Tell({removed}, {});
  }
  static void Reset() {
    const std::lock_guard lock(mutex);
    for (const auto& port : plugged) port->is_gone = true;
    plugged.clear();
  }
  static void Start(Port& port, int stream, FrameArrived call, void* user) {
    const std::lock_guard lock(mutex);
    port.started[stream] = {call, user};
  }
  /// Returns when no image is being delivered any more.
  static void Stop(Port& port, const std::vector<int>& streams) {
    std::unique_lock lock(mutex);
    for (const int stream : streams) port.started.erase(stream);
    changed.wait(lock, [&] { return port.num_delivering == 0; });
  }
  /// Calls back with what `make` makes for the camera. False if nobody has started that stream.
  template <typename Make>
  static bool Deliver(const std::string& serial, int stream, Make&& make) {
    std::shared_ptr<Port> port;
    Started to;
    {
      const std::lock_guard lock(mutex);
      port = Find(serial);
      if (!port || !port->started.contains(stream)) return false;
      to = port->started[stream];
      ++port->num_delivering;
    }
    to.call(make(*port), to.user);
    const std::lock_guard lock(mutex);
    --port->num_delivering;
    changed.notify_all();
    return true;
  }
  static void Set(Port& port, int sensor, int setting, float value) {
    const std::lock_guard lock(mutex);
    port.settings[{sensor, setting}] = value;
  }
  /// Nothing was set: -1.
  static float SettingOf(const std::string& serial, int sensor, int setting) {
    const std::lock_guard lock(mutex);
    const auto port = Find(serial);
    if (!port) return -1;
    const auto found = port->settings.find({sensor, setting});
    return found == port->settings.end() ? -1 : found->second;
  }

 private:
  /// The library makes both lists, and who is called deletes them.
  static void Tell(Ports removed, Ports added) {
    DevicesChanged call = nullptr;
    void* user = nullptr;
    {
      const std::lock_guard lock(mutex);
      call = listener;
      user = listener_user;
    }
    if (call == nullptr) return;
    auto* first = new DeviceList;
    auto* second = new DeviceList;
    first->ports = std::move(removed);
    second->ports = std::move(added);
    call(first, second, user);
  }
};

}  // namespace plumb::testing
