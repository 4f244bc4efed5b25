// Sensors of the Xtion class on the USB bus: plugging and unplugging, and whether this user may
// open them. Does not read their images.
#pragma once

#include <poll.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace plumb {

struct UsbSensor {
  int bus = 0;
  int address = 0;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string model;                  ///< For example "Xtion Pro Live".
  std::string speed;                  ///< For example "480 Mbit/s"; empty if unknown.
  bool permitted = true;              ///< This user may open it.
  std::vector<std::string> problems;  ///< Actual and possible obstacles, each with a remedy.
  bool operator==(const UsbSensor&) const = default;
};

/// Models by USB id (1d27:*); nothing for other devices.
[[nodiscard]] std::optional<std::string> UsbSensorModel(std::uint16_t vendor,
                                                        std::uint16_t product);

/// Watches the bus. Everything is used on the event loop's thread, and nothing blocks. Block
/// signals before, because libusb starts a thread.
class UsbWatcher {
 public:
  using Clock = std::chrono::steady_clock;

  /// @throws DeviceError if libusb cannot watch the bus.
  UsbWatcher();
  ~UsbWatcher();
  UsbWatcher(const UsbWatcher&) = delete;
  UsbWatcher& operator=(const UsbWatcher&) = delete;

  /// Attached sensors by bus and address.
  [[nodiscard]] const std::vector<UsbSensor>& sensors() const;

  /// The descriptors to wait for. The set may change; then `changed` is called, from within a call
  /// of this object.
  [[nodiscard]] std::vector<pollfd> fds() const;
  void SetFdListener(std::function<void()> changed);
  /// Call it when one of them is ready, or at the deadline. @throws DeviceError
  void Dispatch();
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;

  /// Called from Dispatch() after a sensor was plugged in or unplugged.
  void SetListener(std::function<void()> changed);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
