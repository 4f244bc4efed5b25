// SPDX-License-Identifier: Apache-2.0
// Motion of the sensor over the body: a hand-held sweep from head to feet.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "algo/base/pose.hpp"

namespace plumb::simulated {

/// A sensor that stands still, and may be pushed.
struct SensorAtPlace {
  Pose T_world_camera = Pose::Identity();
  double pushed_at_s = 1e9;                ///< Within a tenth of a second.
  Pose T_before_after = Pose::Identity();  ///< In the camera's frame.
  double sway_m = 0.0;                     ///< To and fro along the image's x, twice a second.
};

/// A sweep in its own frame: x from head to feet, z up from the support, origin under the middle of
/// the path.
struct SweepOptions {
  Pose T_world_sweep = Pose::Identity();
  double half_way_m = 0.6;  ///< The sensor moves from x = -half_way_m to +half_way_m.
  double height_m = 0.95;   ///< Above the support.
  double swing_m = 0.22;    ///< Amplitude of the left-right swings.
  double swing_period_s = 3.6;
  double duration_s = 10.0;
  double tremor = 1.0;  ///< Factor of the hand's tremor; 0: none.
  /// Additional trembling of the hand: RMS over 1 to 10 Hz, all axes together. Amplitudes decrease
  /// with frequency, so that every band has the same speed.
  double tremble_m = 0.0;
  double tremble_rad = 0.0;
  std::uint64_t seed = 1;
  std::optional<SensorAtPlace> at_rest = {};  ///< Set: no sweep, and nothing of the above applies.
};

/// The true pose of the colour camera at any time; smooth, a pure function of its options.
class Trajectory {
 public:
  explicit Trajectory(const SweepOptions& options);
  /// @param time_s  From 0 to the sweep's duration; the sensor is static (apart from tremor) before
  ///         and after.
  [[nodiscard]] Pose T_world_camera(double time_s) const;

 private:
  struct Wave {
    double amplitude, frequency_hz, phase;
    [[nodiscard]] double At(double time_s) const;
  };
  using Waves = std::vector<Wave>;
  static double Sum(const Waves& waves, double time_s);
  void AddTremble();

  SweepOptions options_;
  double swing_phase_;
  std::array<Waves, 3> position_;  ///< Drift and tremor, metres.
  std::array<Waves, 3> rotation_;  ///< Likewise, radians, camera frame.
};

}  // namespace plumb::simulated
