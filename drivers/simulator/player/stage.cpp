// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/stage.hpp"

#include <stdexcept>

namespace plumb::simulated {

Stage::Stage(const std::vector<std::string>& files, const std::vector<std::string>& at_rest,
             const std::vector<std::string>& second_at_rest) {
  for (const std::string& file : files)
    scenes_.push_back(std::make_shared<const FrameCacheReader>(file));
  for (const std::string& file : at_rest)
    at_rest_.push_back(std::make_shared<const FrameCacheReader>(file));
  for (const std::string& file : second_at_rest)
    second_at_rest_.push_back(std::make_shared<const FrameCacheReader>(file));
  if (scenes_.empty()) throw std::runtime_error("the virtual sensor's session names no scene");
  for (const auto& scene : scenes_) {
    const FrameCacheShape& a = scene->shape();
    if (a.width != shape().width || a.height != shape().height || a.period_us != shape().period_us)
      throw std::runtime_error("the virtual sensor's scenes differ in size or rate");
  }
  view_.scene = scenes_.front();
}

Stage::View Stage::Now(bool is_second) const {
  const std::lock_guard lock(mutex_);
  View view = view_;
  if (is_second && loop_ < second_at_rest_.size()) {
    view.scene = second_at_rest_[loop_];
    view.motion = Motion::kLoop;
  }
  return view;
}

void Stage::Show(std::size_t scene, Motion motion, std::optional<std::int64_t> origin_us) {
  const std::lock_guard lock(mutex_);
  view_.index = scene % scenes_.size();
  view_.scene = scenes_[view_.index];
  view_.motion = motion;
  view_.origin_us = origin_us;
  view_.epoch += 1;
}

bool Stage::ShowAtRest(std::size_t loop) {
  const std::lock_guard lock(mutex_);
  if (loop >= at_rest_.size()) return false;
  if (view_.motion != Motion::kLoop) view_.loops_since = std::chrono::steady_clock::now();
  loop_ = loop;
  view_.scene = at_rest_[loop];
  view_.motion = Motion::kLoop;
  view_.origin_us.reset();
  view_.epoch += 1;
  return true;
}

void Stage::SetSpeed(double speed) {
  const std::lock_guard lock(mutex_);
  view_.speed = speed;
}

}  // namespace plumb::simulated
