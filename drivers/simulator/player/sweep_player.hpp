// SPDX-License-Identifier: Apache-2.0
// Plays the stage to one open virtual unit, in real time.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <thread>
#include <vector>

#include "drivers/simulator/player/stage.hpp"

namespace plumb::simulated {

/// One pair as delivered by the unit.
struct PlayedPair {
  CachedStamps stamps;  ///< From the unit's own clock.
  int frame_index = 0;
  std::span<const std::uint8_t> rgb;
  std::span<const std::uint16_t> depth_mm;
  bool small = false;       ///< Has half the size, and states it.
  bool depth_only = false;  ///< Its colour image never arrives.
};

/// Its thread delivers one pair per period while there is a user.
class SweepPlayer {
 public:
  /// @param wanted, emit  Called on the player's thread until it is destroyed.
  SweepPlayer(std::shared_ptr<Unit> unit, std::shared_ptr<const Stage> stage,
              std::function<bool()> wanted, std::function<void(const PlayedPair&)> emit);
  ~SweepPlayer();
  SweepPlayer(const SweepPlayer&) = delete;
  SweepPlayer& operator=(const SweepPlayer&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  void Run(const std::stop_token& stop);
  void Tick(const std::stop_token& stop);
  [[nodiscard]] std::uint32_t FrameOfLoop() const;
  void Give(PlayedPair pair, const std::stop_token& stop);
  void Load(std::uint32_t frame);
  void SleepUntil(Clock::time_point time, const std::stop_token& stop);

  const std::shared_ptr<Unit> unit_;
  const std::shared_ptr<const Stage> stage_;
  const std::function<bool()> wanted_;
  const std::function<void(const PlayedPair&)> emit_;

  std::mutex mutex_;  ///< Used only for waiting.
  std::condition_variable_any wake_;

  // Members of the thread.
  Stage::View view_;
  std::vector<std::uint8_t> rgb_;
  std::vector<std::uint16_t> depth_mm_;
  CachedStamps loaded_stamps_;
  std::optional<std::uint32_t> loaded_frame_;
  std::uint32_t next_ = 0;  ///< Position in the scene.
  /// Before a sweep, so that earlier frames in transit are not taken for its beginning.
  int wait_ticks_ = 0;
  std::int64_t device_us_ = 1000000;  ///< Clock of the unit.
  std::int64_t sweep_begin_us_ = 0;
  int frame_index_ = 0;
  Clock::time_point due_;
  std::jthread thread_;  ///< Last member: joined before the others are destroyed.
};

}  // namespace plumb::simulated
