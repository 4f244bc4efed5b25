#include "drivers/virtual/stage.hpp"

#include <stdexcept>

namespace plumb::simulated {

Stage::Stage(const std::vector<std::string>& files) {
  for (const std::string& file : files)
    scenes_.push_back(std::make_shared<const FrameCacheReader>(file));
  if (scenes_.empty()) throw std::runtime_error("the virtual sensor's session names no scene");
  for (const auto& scene : scenes_) {
    const FrameCacheShape& a = scene->shape();
    if (a.width != shape().width || a.height != shape().height || a.period_us != shape().period_us)
      throw std::runtime_error("the virtual sensor's scenes differ in size or rate");
  }
  view_.scene = scenes_.front();
}

Stage::View Stage::Now() const {
  const std::lock_guard lock(mutex_);
  return view_;
}

void Stage::Show(std::size_t scene, Motion motion, std::optional<std::int64_t> origin_us) {
  const std::lock_guard lock(mutex_);
  view_.index = scene % scenes_.size();
  view_.scene = scenes_[view_.index];
  view_.motion = motion;
  view_.origin_us = origin_us;
  view_.epoch += 1;
}

void Stage::SetSpeed(double speed) {
  const std::lock_guard lock(mutex_);
  view_.speed = speed;
}

}  // namespace plumb::simulated
