// SPDX-License-Identifier: Apache-2.0
// The frames shown by the virtual units, and the commands to them. Shared by the command thread and
// the units' own.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "drivers/simulator/player/frame_cache.hpp"

namespace plumb::simulated {

/// The scenes, the current one and the mode of playing.
class Stage {
 public:
  enum class Motion {
    kStill,  ///< Holds the first frame.
    kSweep,  ///< Plays from the first frame and then holds the last one.
    /// Plays from the first frame and then delivers nothing, for recordings of exactly one sweep.
    kSweepOnce,
    kLoop,  ///< Of a sensor at rest: again and again.
  };
  struct View {
    std::shared_ptr<const FrameCacheReader> scene;
    std::size_t index = 0;
    Motion motion = Motion::kStill;
    std::uint64_t epoch = 0;  ///< Changes with every command: playing restarts.
    double speed = 1.0;       ///< 0: as fast as possible.
    /// kLoop: when it began. All units are at the same place of it.
    std::chrono::steady_clock::time_point loops_since = {};
    /// Stamp at the sweep's time 0; nothing: the time at which it starts.
    std::optional<std::int64_t> origin_us;
  };

  /// @throws std::runtime_error unless there are scenes, all of the same size and rate.
  /// @param at_rest  Loops that a sensor at rest sees; may be none.
  /// @param second_at_rest  Those of a second unit, which sees nothing else.
  explicit Stage(const std::vector<std::string>& files,
                 const std::vector<std::string>& at_rest = {},
                 const std::vector<std::string>& second_at_rest = {});

  [[nodiscard]] const FrameCacheShape& shape() const { return scenes_.front()->shape(); }
  [[nodiscard]] std::size_t size() const { return scenes_.size(); }
  [[nodiscard]] View Now(bool is_second = false) const;
  void Show(std::size_t scene, Motion motion, std::optional<std::int64_t> origin_us = {});
  /// One of the loops, until something else is shown; false if there is none.
  [[nodiscard]] bool ShowAtRest(std::size_t loop);
  void SetSpeed(double speed);

 private:
  std::vector<std::shared_ptr<const FrameCacheReader>> scenes_, at_rest_, second_at_rest_;
  mutable std::mutex mutex_;
  View view_;
  std::size_t loop_ = 0;  ///< Shown last.
};

/// Faults of the next frames, each as a real sensor or its driver may have it.
enum class Glitch { kNone, kLate, kDouble, kOld, kSize, kLone };

/// One unit from plugging in to unplugging.
struct Unit {
  std::string serial;
  std::string uri;
  bool is_second = false;  ///< Sees the body from its other side.
  std::atomic<bool> gone{false};
  std::atomic<bool> stalled{false};
  std::atomic<bool> failed{false};
  std::atomic<Glitch> glitch{Glitch::kNone};
  std::atomic<int> glitches_left{0};
  /// Last frame that was delivered since the last command.
  std::atomic<std::optional<std::uint32_t>> position{std::nullopt};
  std::mutex delivering;                        ///< Held while a frame is delivered.
  std::atomic<int> changes_pending{0};          ///< Changes that wait for `delivering` or hold it.
  std::condition_variable_any changes_applied;  ///< None is pending any more.

  [[nodiscard]] bool silent() const { return gone || stalled || failed; }
};

/// While it exists no frame is delivered: what is changed holds from the next frame on.
class BetweenFrames {
 public:
  explicit BetweenFrames(Unit& unit) : unit_(unit) {
    ++unit_.changes_pending;  // the player lets it go first, however fast its frames come
    unit_.delivering.lock();
  }
  ~BetweenFrames() {
    --unit_.changes_pending;
    unit_.delivering.unlock();
    unit_.changes_applied.notify_all();
  }
  BetweenFrames(const BetweenFrames&) = delete;
  BetweenFrames& operator=(const BetweenFrames&) = delete;

 private:
  Unit& unit_;
};

}  // namespace plumb::simulated
