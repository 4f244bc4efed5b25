// Sensors of the Xtion class on the USB bus: when they come and go, and whether this user may open
// them. Their images are not its business.
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
  std::string model;                  ///< "Xtion Pro Live" and the like.
  std::string speed;                  ///< "480 Mbit/s"; empty: unknown.
  bool permitted = true;              ///< This user may open it.
  std::vector<std::string> problems;  ///< Actual and possible obstacles, each with a remedy.
  bool operator==(const UsbSensor&) const = default;
};

/// Models by USB id (1d27:*); nothing for other devices.
[[nodiscard]] std::optional<std::string> UsbSensorModel(std::uint16_t vendor,
                                                        std::uint16_t product);

/// Watches the bus. One thread, the event loop's, uses everything; nothing blocks. Block signals
/// before: libusb starts a thread.
class UsbWatcher {
 public:
  using Clock = std::chrono::steady_clock;

  /// @throws DeviceError if libusb cannot watch the bus.
  UsbWatcher();
  ~UsbWatcher();
  UsbWatcher(const UsbWatcher&) = delete;
  UsbWatcher& operator=(const UsbWatcher&) = delete;

  /// Sensors that are attached, by bus and address.
  [[nodiscard]] const std::vector<UsbSensor>& sensors() const;

  /// The descriptors to wait for. The set may change; then `changed` is called, from within a call
  /// of this object.
  [[nodiscard]] std::vector<pollfd> fds() const;
  void SetFdListener(std::function<void()> changed);
  /// To be called when one of them is ready, or at the deadline. @throws DeviceError
  void Dispatch();
  [[nodiscard]] std::optional<Clock::time_point> deadline() const;

  /// Called from Dispatch() after a sensor came or went.
  void SetListener(std::function<void()> changed);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
