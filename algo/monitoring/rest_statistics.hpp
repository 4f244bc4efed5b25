// SPDX-License-Identifier: Apache-2.0
// How fits scatter while the body lies still: what the uncertainty of every later fit rests on.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/monitoring/motion_fit.hpp"
#include "algo/monitoring/sensor_at_rest.hpp"

namespace plumb {

/// Sensors whose equations are summed, ascending.
using SensorSet = std::vector<std::size_t>;

/// Frames whose mean RestStatistics::share_of_mean describes.
inline constexpr std::size_t kFramesOfMean = 4;

/// Of one set of sensors.
struct RestStatistics {
  Pose T_zero = Pose::Identity();             ///< What the fits say of the zero itself.
  Vector6d spread = Vector6d::Zero();         ///< Of single fits: rotation vector, translation.
  Vector6d inflation = Vector6d::Ones();      ///< Of the formal standard deviations.
  Vector6d share_of_mean = Vector6d::Ones();  ///< Variance of a mean over that of a frame.
  Matrix6d information = Matrix6d::Identity();
  std::vector<double> residual = {};  ///< By sensor: median of ViewFit::residual.
};

/// Rotation vector and translation of the centroid.
[[nodiscard]] Vector6d TwistAbout(const Pose& T, const Eigen::Vector3d& centroid);
/// Of the motion, without what the breathing may be; directions that nothing determines are finite.
[[nodiscard]] Matrix6d FormalCovariance(const MotionFit& fit);

/// @param fits  Successive ones of the body at rest; at least one more than kFramesOfMean.
[[nodiscard]] RestStatistics StatisticsOf(std::span<const MotionFit> fits,
                                          const Eigen::Vector3d& centroid);

/// Fits the frames that the sensors collected while the body lay still, for each set of sensors, a
/// few at a time: all at once would stall a live loop. In whatever portions, the same bits.
class RestFits {
 public:
  /// @param sensors  With their index; borrowed, after their Zero().
  RestFits(std::vector<std::pair<std::size_t, const SensorAtRest*>> sensors,
           const Eigen::Vector3d& centroid);

  [[nodiscard]] std::size_t size() const { return jobs_.size(); }
  /// Makes the next fits. @return Whether all are made.
  bool Make(std::size_t count);
  /// Once all are made. Sets of which too few frames were collected are missing.
  [[nodiscard]] std::map<SensorSet, RestStatistics> Statistics() const;

 private:
  struct Job {
    SensorSet sensors;
    std::vector<std::size_t> frames;  ///< By sensor of the set.
  };
  void AddJobs(const SensorSet& sensors);

  std::map<std::size_t, const SensorAtRest*> sensors_;
  Eigen::Vector3d centroid_;
  std::vector<Job> jobs_;
  std::vector<MotionFit> fits_;
};

}  // namespace plumb
