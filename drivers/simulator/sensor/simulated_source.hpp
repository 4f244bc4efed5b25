// SPDX-License-Identifier: Apache-2.0
// A simulated sweep as a stream of frames, with its true values.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "algo/types/frame.hpp"
#include "drivers/simulator/sensor/color_camera.hpp"
#include "drivers/simulator/sensor/depth_camera.hpp"
#include "drivers/simulator/sensor/other_projector.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"
#include "drivers/simulator/world/scene_events.hpp"
#include "drivers/simulator/world/trajectory.hpp"
#include "drivers/simulator/world/world.hpp"

namespace plumb {

/// Parameters of one sweep, in addition to the world and the unit.
struct SimulatedSweep {
  simulated::SweepOptions motion;
  int num_frames = 150;
  double rate_hz = 15.0;
  double start_time_s = 0.0;  ///< Stamp at the trajectory's time 0.
  int reference_marker = 0;
  double on_before_s = 0.0;  ///< Time that the sensor had been on at the trajectory's time 0.
  std::uint64_t seed = 1;    ///< Seed for the noise of its images and stamps.
  simulated::SceneEvents events = {};
  /// Only every n-th colour image is rendered, and shown until the next one: for a sensor at rest.
  int color_every = 1;
  double lost_frames = 0.0;  ///< Probability of one, besides the unit's own.
  double late_frames = 0.0;  ///< Likewise: stamped late by most of a frame's time.
  /// A second structured-light sensor shines on the same place.
  bool other_projector = false;
};

/// True values for one frame. Times on the scale of the stamps, without their errors.
struct FrameTruth {
  double color_time_s = 0.0;  ///< Mid-exposure of the colour image's middle row.
  double depth_time_s = 0.0;
  Pose T_world_camera_at_color = Pose::Identity();  ///< Pose of the true colour camera.
  Pose T_world_camera_at_depth = Pose::Identity();
  simulated::DepthShot depth;  ///< Includes the depth before registration.
};

/// Renders one sweep frame by frame; the same bits for the same arguments. Not thread-safe,
/// parallel inside.
class SimulatedSource : public FrameSource {
 public:
  SimulatedSource(std::shared_ptr<const simulated::World> world, const simulated::SensorUnit& unit,
                  const SimulatedSweep& sweep);

  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override;

  /// True values of the frame that Next() returned last.
  [[nodiscard]] const FrameTruth& truth() const { return truth_; }
  /// True pose of the colour camera at a time on the scale of the stamps.
  [[nodiscard]] Pose T_world_camera(double time_s) const {
    return trajectory_.T_world_camera(time_s - sweep_.start_time_s);
  }
  [[nodiscard]] const simulated::SensorUnit& unit() const { return unit_; }
  [[nodiscard]] const SimulatedSweep& sweep() const { return sweep_; }

 private:
  /// Treatment of a pair of images by the driver.
  enum class Fate { kGiven, kLost, kDoubled };
  [[nodiscard]] Fate FateOf(int index) const;
  void Take(Frame& frame, double color_time, double depth_time);

  std::shared_ptr<const simulated::World> world_;
  simulated::SensorUnit unit_;
  SimulatedSweep sweep_;
  simulated::Trajectory trajectory_;
  simulated::ColorCamera color_camera_;
  simulated::DepthCamera depth_camera_;
  std::optional<simulated::OtherProjector> other_projector_;
  StreamInfo info_;
  FrameTruth truth_;
  int next_ = 0;
  std::int64_t given_ = 0;
  cv::Mat color_;  ///< The last one rendered.
  Frame last_;     ///< Kept only if the driver may repeat it.
};

}  // namespace plumb
