// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/simulated_source.hpp"

#include <cmath>
#include <stdexcept>

#include "drivers/simulator/world/random.hpp"
#include "drivers/simulator/world/scene_events.hpp"

namespace plumb {
namespace {

constexpr double kFirstFrame_s = 0.05;
constexpr double kWarmUpTime_s = 600.0;

// A value that steps at random times: the index of the step at a given time.
std::uint64_t StepAt(std::uint64_t seed, double shortest_s, double longest_s, double time_s) {
  simulated::RandomStream random(seed);
  std::uint64_t step = 0;
  for (double end = random.Uniform(0, longest_s); end < time_s;
       end += random.Uniform(shortest_s, longest_s))
    ++step;
  return step;
}

// Gain of red, green and blue by automatic exposure and white balance.
Eigen::Vector3f GainAt(const simulated::SensorUnit& unit, std::uint64_t seed, double time_s) {
  Eigen::Vector3f gain = Eigen::Vector3f::Ones();
  if (unit.steps_exposure) {
    const std::uint64_t step = StepAt(simulated::Hash(seed, 55), 0.8, 2.5, time_s);
    simulated::RandomStream random(simulated::Hash(seed, 56, step));
    gain *= static_cast<float>(std::exp2(random.Uniform(-0.4, 0.2)));
  }
  if (unit.steps_white_balance) {
    const std::uint64_t step = StepAt(simulated::Hash(seed, 57), 1.0, 3.0, time_s);
    simulated::RandomStream random(simulated::Hash(seed, 58, step));
    gain.x() *= static_cast<float>(1.0 + random.Within(0.06));
    gain.z() *= static_cast<float>(1.0 + random.Within(0.06));
  }
  return gain;
}

}  // namespace

SimulatedSource::SimulatedSource(std::shared_ptr<const simulated::World> world,
                                 const simulated::SensorUnit& unit, const SimulatedSweep& sweep)
    : world_(std::move(world)),
      unit_(unit),
      sweep_(sweep),
      trajectory_(sweep.motion),
      color_camera_(unit),
      depth_camera_(unit) {
  if (!world_) throw std::invalid_argument("simulated source needs a world");
  if (sweep.num_frames < 1 || !(sweep.rate_hz > 0) || !(sweep.rate_hz <= 60))
    throw std::invalid_argument("simulated sweep needs frames and a rate up to 60 Hz");
  if (sweep.other_projector)
    other_projector_.emplace(sweep.seed, unit_.color_written.width, unit_.color_written.height);
  info_.intrinsics = unit_.color_written;
  info_.depth_sensor = unit_.depth_sensor;
  info_.depth_noise = ClassOf(unit_.depth_sensor).noise;
  info_.usable_depth = ClassOf(unit_.depth_sensor).range;
  info_.room_markers = {.dictionary = simulated::kDictionary,
                        .length_m = simulated::kMarkerLength,
                        .reference = sweep_.reference_marker};
  std::int64_t num_frames = 0;
  for (int i = 0; i < sweep_.num_frames; ++i) num_frames += FateOf(i) != Fate::kLost ? 1 : 0;
  info_.num_frames = num_frames;
}

SimulatedSource::Fate SimulatedSource::FateOf(int index) const {
  if (index == 0 || index + 1 == sweep_.num_frames) return Fate::kGiven;
  const double chance =
      simulated::UnitUniform(simulated::Hash(sweep_.seed, 54, static_cast<std::uint64_t>(index)));
  const double lost = unit_.lost_frames + sweep_.lost_frames;
  if (chance < lost) return Fate::kLost;
  return chance < lost + unit_.doubled_frames ? Fate::kDoubled : Fate::kGiven;
}

void SimulatedSource::Take(Frame& frame, double color_time, double depth_time) {
  using simulated::Hash;
  const auto index = static_cast<std::uint64_t>(next_);
  truth_.color_time_s = sweep_.start_time_s + color_time;
  truth_.depth_time_s = sweep_.start_time_s + depth_time;
  truth_.T_world_camera_at_color = trajectory_.T_world_camera(color_time);
  truth_.T_world_camera_at_depth = trajectory_.T_world_camera(depth_time);
  const auto world_at = [&](double time, const Pose& T_world_camera) {
    if (!sweep_.events.Any()) return world_;
    return std::make_shared<const simulated::World>(
        WorldAt(*world_, sweep_.events, time, T_world_camera));
  };
  Eigen::Vector3f gain = GainAt(unit_, sweep_.seed, color_time);
  if (sweep_.events.live && sweep_.events.live->DarkAt(color_time)) gain.setZero();
  if (color_.empty() || next_ % sweep_.color_every == 0) {
    color_ = color_camera_.Render(*world_at(color_time, truth_.T_world_camera_at_color),
                                  trajectory_, color_time, Hash(sweep_.seed, 52, index), gain);
  }
  frame.color_rgb = color_;
  const double warm_up =
      unit_.warm_up * std::exp(-(sweep_.on_before_s + depth_time) / kWarmUpTime_s);
  truth_.depth =
      depth_camera_.Render(*world_at(depth_time, truth_.T_world_camera_at_depth), trajectory_,
                           depth_time, Hash(sweep_.seed, 53, index), warm_up);
  truth_.depth.registered.convertTo(frame.depth_m, CV_32F, 1.0 / unit_.depth_units_per_metre);
  if (other_projector_) other_projector_->Disturb(depth_time, frame.depth_m);
}

std::optional<Frame> SimulatedSource::Next() {
  while (next_ < sweep_.num_frames && FateOf(next_) == Fate::kLost) ++next_;
  if (next_ >= sweep_.num_frames) return std::nullopt;
  const double color_time = kFirstFrame_s + next_ / sweep_.rate_hz;
  const double depth_time = color_time + unit_.depth_delay_s;

  Frame frame;
  simulated::RandomStream random(
      simulated::Hash(sweep_.seed, 51, static_cast<std::uint64_t>(next_)));
  if (FateOf(next_) == Fate::kDoubled)
    frame = last_;
  else
    Take(frame, color_time, depth_time);
  frame.index = given_++;
  frame.color_time_s = sweep_.start_time_s + color_time + unit_.color_stamp_bias_s +
                       unit_.stamp_jitter_s * random.Normal();
  frame.depth_time_s = sweep_.start_time_s + depth_time + unit_.stamp_jitter_s * random.Normal();
  constexpr double kLate = 0.8;
  if (sweep_.late_frames > 0 && random.Uniform() < sweep_.late_frames)
    frame.depth_time_s += kLate / sweep_.rate_hz;
  if (unit_.doubled_frames > 0) last_ = frame;
  ++next_;
  return frame;
}

}  // namespace plumb
