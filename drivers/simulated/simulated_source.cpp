#include "drivers/simulated/simulated_source.hpp"

#include <cmath>
#include <stdexcept>

#include "drivers/simulated/random.hpp"

namespace plumb {
namespace {

constexpr double kFirstFrame_s = 0.05;

}  // namespace

SimulatedSource::SimulatedSource(std::shared_ptr<const simulated::World> world, const simulated::SensorUnit& unit,
                                 const SimulatedSweep& sweep)
    : world_(std::move(world)), unit_(unit), sweep_(sweep), trajectory_(sweep.motion), color_camera_(unit), depth_camera_(unit) {
  if (!world_) throw std::invalid_argument("simulated source needs a world");
  if (sweep.num_frames < 1 || !(sweep.rate_hz > 0) || !(sweep.rate_hz <= 60))
    throw std::invalid_argument("simulated sweep needs frames and a rate up to 60 Hz");
  info_.intrinsics = unit_.color_written;
  info_.marker_dictionary = simulated::kDictionary;
  info_.marker_length_m = simulated::kMarkerLength;
  info_.reference_marker = sweep_.reference_marker;
  info_.num_frames = sweep_.num_frames;
}

std::optional<Frame> SimulatedSource::Next() {
  if (next_ >= sweep_.num_frames) return std::nullopt;
  const auto index = static_cast<std::uint64_t>(next_);
  const double color_time = kFirstFrame_s + next_ / sweep_.rate_hz;
  const double depth_time = color_time + unit_.depth_delay_s;

  Frame frame;
  frame.index = next_++;
  simulated::RandomStream random(simulated::Hash(sweep_.seed, 51, index));
  frame.color_time_s = sweep_.start_time_s + color_time + unit_.color_stamp_bias_s + unit_.stamp_jitter_s * random.Normal();
  frame.depth_time_s = sweep_.start_time_s + depth_time + unit_.stamp_jitter_s * random.Normal();
  frame.color_rgb = color_camera_.Render(*world_, trajectory_, color_time, simulated::Hash(sweep_.seed, 52, index));

  truth_.color_time_s = sweep_.start_time_s + color_time;
  truth_.depth_time_s = sweep_.start_time_s + depth_time;
  truth_.T_world_camera_at_color = trajectory_.T_world_camera(color_time);
  truth_.T_world_camera_at_depth = trajectory_.T_world_camera(depth_time);
  truth_.depth = depth_camera_.Render(*world_, trajectory_, depth_time, simulated::Hash(sweep_.seed, 53, index));
  truth_.depth.registered.convertTo(frame.depth_m, CV_32F, 1.0 / unit_.depth_units_per_metre);
  return frame;
}

}  // namespace plumb
