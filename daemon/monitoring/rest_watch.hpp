// SPDX-License-Identifier: Apache-2.0
// Watches between sweeps whether the sensor has been put down where it can monitor the body: then a
// press starts that instead of a sweep.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>

#include "daemon/loop/event_loop.hpp"
#include "daemon/sweep/sensor_thread.hpp"

namespace plumb {

/// Used on the loop's thread. Looks at four images a second on a thread of its own, and at none
/// where there is nothing to monitor.
class RestWatch {
 public:
  /// The arguments are borrowed. @param changed  Called on the loop's thread.
  RestWatch(EventLoop& loop, const SensorThread& sensors, std::function<void()> changed);
  ~RestWatch();
  RestWatch(const RestWatch&) = delete;
  RestWatch& operator=(const RestWatch&) = delete;

  /// @param scene  Folder of the scene whose markers have to be seen; empty: watches nothing, and
  ///        the sensor does not count as at rest.
  void Watch(const std::filesystem::path& scene);
  [[nodiscard]] bool IsAtRest() const { return is_at_rest_; }

 private:
  void Run(const std::stop_token& stop);
  /// Until something else is wanted.
  void Look(const std::filesystem::path& scene, std::uint64_t turn, const std::stop_token& stop);
  void Tell(std::uint64_t turn, bool is_at_rest);

  EventLoop& loop_;
  const SensorThread& sensors_;
  std::function<void()> changed_;
  bool is_at_rest_ = false;  ///< Of wanted_; the loop's.
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::filesystem::path wanted_;  ///< Guarded.
  std::uint64_t turn_ = 0;        ///< Guarded: counts what was wanted.
  std::jthread thread_;           ///< Last: starts when the members above are initialised.
};

}  // namespace plumb
