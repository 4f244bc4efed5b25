// SPDX-License-Identifier: Apache-2.0
// The virtual units and their commands, for both ways of showing them to a program: the in-process
// provider and the plug-in of OpenNI2.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/simulator/player/stage.hpp"

namespace plumb::simulated {

inline constexpr std::uint16_t kVirtualUsbVendor = 0x1d27;
inline constexpr std::uint16_t kVirtualUsbProduct = 0x0601;  // Xtion Pro Live

/// Units that are plugged in and unplugged by command. Thread-safe.
class VirtualBus {
 public:
  enum class Event { kPlugged, kUnplugged, kFailed, kWorksAgain };
  /// Called on the thread that gave the command, without a lock held: it may open or close a unit.
  using Listener = std::function<void(const Unit& unit, Event event)>;

  /// @param serial  Used by `plug` without a serial.
  /// @param second  Of the unit that sees the stage's second loops; empty: none.
  VirtualBus(std::shared_ptr<Stage> stage, std::string serial, std::string second = {});

  void SetListener(Listener listener);

  /// Executes one line as listed in drivers/simulator/player/README.md. @return "ok ..." or
  /// "refused: why".
  std::string Obey(const std::string& line);

  [[nodiscard]] std::vector<std::shared_ptr<Unit>> units() const;
  /// Null if no unit with that address is plugged in.
  [[nodiscard]] std::shared_ptr<Unit> At(const std::string& uri) const;
  [[nodiscard]] const std::shared_ptr<Stage>& stage() const { return stage_; }
  /// Whether the driver was ordered not to return when it is stopped.
  [[nodiscard]] bool hangs() const { return hangs_; }

 private:
  std::string Plug(const std::string& serial);
  std::string Unplug(const std::string& serial);
  std::string SetFailed(const std::string& serial, bool failed);
  std::string Rewind(const std::string& how, std::optional<std::int64_t> origin_us);
  std::string SetSpeed(double speed);
  std::string State() const;
  std::string OnUnit(const std::string& serial, const std::function<void(Unit&)>& change);
  [[nodiscard]] std::shared_ptr<Unit> Find(const std::string& serial) const;
  void Report(const Unit& unit, Event event) const;

  const std::shared_ptr<Stage> stage_;
  const std::string default_serial_, second_serial_;
  mutable std::mutex mutex_;
  Listener listener_;
  std::list<std::shared_ptr<Unit>> units_;
  int num_plugs_ = 0;
  std::atomic<bool> hangs_ = false;
};

}  // namespace plumb::simulated
