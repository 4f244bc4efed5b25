// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/sweep_player.hpp"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

namespace plumb::simulated {
namespace {

constexpr int kTicksBeforeSweep = 2;
constexpr std::chrono::milliseconds kIdle{5};
constexpr std::chrono::milliseconds kBetweenDoubles{8};

}  // namespace

SweepPlayer::SweepPlayer(std::shared_ptr<Unit> unit, std::shared_ptr<const Stage> stage,
                         std::function<bool()> wanted, std::function<void(const PlayedPair&)> emit)
    : unit_(std::move(unit)),
      stage_(std::move(stage)),
      wanted_(std::move(wanted)),
      emit_(std::move(emit)),
      rgb_(stage_->shape().color_bytes()),
      depth_mm_(stage_->shape().depth_bytes() / 2) {
  view_.epoch = ~std::uint64_t{0};
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

SweepPlayer::~SweepPlayer() {
  thread_.request_stop();
  wake_.notify_all();
}

void SweepPlayer::SleepUntil(Clock::time_point time, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  wake_.wait_until(lock, stop, time, [] { return false; });
}

void SweepPlayer::Run(const std::stop_token& stop) {
  due_ = Clock::now();
  while (!stop.stop_requested()) {
    if (!wanted_()) {
      SleepUntil(Clock::now() + kIdle, stop);
      due_ = Clock::now();
      continue;
    }
    try {
      Tick(stop);
    } catch (const std::exception&) {
      // the cache cannot be read any more: the unit has failed, and its user sees a stall
      unit_->failed = true;
    }
    const std::int64_t period_us = stage_->shape().period_us;
    device_us_ += period_us;
    if (view_.speed > 0) {
      const std::chrono::microseconds period(
          static_cast<std::int64_t>(static_cast<double>(period_us) / view_.speed));
      // Delays are made up slowly, because OpenNI2 keeps only the newest image of a stream and a
      // burst would be lost in part.
      due_ = std::max(due_ + period, Clock::now() + period / 2);
      SleepUntil(due_, stop);
    } else {
      due_ = Clock::now();
    }
  }
}

std::uint32_t SweepPlayer::FrameOfLoop() const {
  const std::chrono::duration<double, std::micro> since = Clock::now() - view_.loops_since;
  const double frames = view_.speed * since.count() / stage_->shape().period_us;
  return static_cast<std::uint32_t>(std::fmod(frames, view_.scene->shape().num_frames));
}

void SweepPlayer::Tick(const std::stop_token& stop) {
  std::unique_lock delivering(unit_->delivering);
  if (!unit_->changes_applied.wait(delivering, stop, [&] { return unit_->changes_pending == 0; }))
    return;
  if (Stage::View now = stage_->Now(unit_->is_second); now.epoch != view_.epoch) {
    const bool loops_on = view_.motion == Stage::Motion::kLoop && now.motion == view_.motion &&
                          now.loops_since == view_.loops_since;
    view_ = std::move(now);
    if (!loops_on) next_ = view_.motion == Stage::Motion::kLoop ? FrameOfLoop() : 0;
    loaded_frame_.reset();
    const bool sweeps =
        view_.motion != Stage::Motion::kStill && view_.motion != Stage::Motion::kLoop;
    wait_ticks_ = sweeps ? kTicksBeforeSweep : 0;
    unit_->position = std::nullopt;
  } else {
    view_.speed = now.speed;
  }
  if (wait_ticks_ > 0) {
    --wait_ticks_;
    return;
  }
  const std::uint32_t last = view_.scene->shape().num_frames - 1;
  const bool loops = view_.motion == Stage::Motion::kLoop;
  if (loops && next_ > last) next_ = 0;
  const bool in_sweep = view_.motion != Stage::Motion::kStill && !loops && next_ <= last;
  if (!in_sweep && view_.motion == Stage::Motion::kSweepOnce) return;
  Load(std::min(next_, last));
  PlayedPair shown;
  if (in_sweep) {
    if (next_ == 0)
      sweep_begin_us_ = view_.origin_us.value_or(device_us_ - loaded_stamps_.color_us);
    shown.stamps = {sweep_begin_us_ + loaded_stamps_.color_us,
                    sweep_begin_us_ + loaded_stamps_.depth_us};
    ++next_;
  } else {
    shown.stamps = {device_us_, device_us_ + loaded_stamps_.depth_us - loaded_stamps_.color_us};
    if (loops) ++next_;
  }
  if (unit_->silent()) return;
  shown.frame_index = ++frame_index_;
  if (unit_->glitch == Glitch::kLate && unit_->glitches_left > 0)
    SleepUntil(Clock::now() + std::chrono::microseconds(3 * view_.scene->shape().period_us), stop);
  Give(shown, stop);
  unit_->position = loaded_frame_.value();
}

void SweepPlayer::Load(std::uint32_t frame) {
  if (loaded_frame_ == frame) return;
  loaded_stamps_ = view_.scene->Read(frame, rgb_, depth_mm_);
  loaded_frame_ = frame;
}

void SweepPlayer::Give(PlayedPair pair, const std::stop_token& stop) {
  const Glitch glitch = unit_->glitches_left > 0 ? unit_->glitch.load() : Glitch::kNone;
  if (glitch != Glitch::kNone) --unit_->glitches_left;
  pair.rgb = rgb_;
  pair.depth_mm = depth_mm_;
  PlayedPair first = pair;
  first.small = glitch == Glitch::kSize;
  first.depth_only = glitch == Glitch::kLone;
  emit_(first);
  if (glitch != Glitch::kDouble && glitch != Glitch::kOld) return;
  SleepUntil(Clock::now() + kBetweenDoubles, stop);
  if (glitch == Glitch::kOld) {
    pair.stamps.color_us -= 3 * stage_->shape().period_us;
    pair.stamps.depth_us -= 3 * stage_->shape().period_us;
  }
  emit_(pair);
}

}  // namespace plumb::simulated
