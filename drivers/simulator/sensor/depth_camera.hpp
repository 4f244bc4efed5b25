// SPDX-License-Identifier: Apache-2.0
// Renders the images of the simulated depth camera, registered to the colour camera.
#pragma once

#include <cstdint>
#include <span>

#include <opencv2/core/mat.hpp>

#include "drivers/simulator/sensor/other_classes.hpp"
#include "drivers/simulator/sensor/ray_caster.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"

namespace plumb::simulated {

/// A depth image with its intermediate results.
struct DepthShot {
  /// CV_16UC1 on the colour camera's grid, in units of SensorUnit::depth_units_per_metre, 0 where
  /// nothing was measured.
  cv::Mat registered;
  /// CV_32FC1 on the infrared camera's grid: measured depth, 0 where nothing was measured.
  cv::Mat measured_m;
  /// CV_32FC1 on the same grid: true depth along each pixel's own centre or jittered ray at the
  /// time its row was read.
  cv::Mat true_m;
};

/// What the infrared camera sees of a world at one moment, before anything is measured.
struct DepthView {
  cv::Mat true_m;            ///< As DepthShot has it.
  cv::Mat incidence_cosine;  ///< CV_32FC1; may be empty.
  cv::Mat skin;              ///< CV_8UC1; may be empty.
};

/// Renders depth images by the chain true z -> scale, offset, bow, field -> lateral jitter ->
/// correlated axial noise -> quantisation -> projector shadow -> drop-outs and flying pixels ->
/// registration. Immutable; parallel inside, and the result does not depend on the number of
/// threads.
class DepthCamera {
 public:
  explicit DepthCamera(const SensorUnit& unit);
  /// @param time_s  Trajectory time at which the middle row is taken; the others follow
  ///         SensorUnit::depth_readout_s.
  /// @param noise_seed  Seed for this image.
  /// @param warm_up  Scale error at this moment, in addition to the unit's own.
  [[nodiscard]] DepthShot Render(const World& world, const Trajectory& trajectory, double time_s,
                                 std::uint64_t noise_seed, double warm_up = 0.0) const;
  /// The two parts of Render(): a still view can be measured again and again, each time with its
  /// own noise, for much less time; only where its edges lie in the image then stays the same.
  [[nodiscard]] DepthView See(const World& world, const Trajectory& trajectory, double time_s,
                              std::uint64_t noise_seed) const;
  [[nodiscard]] DepthShot Measure(const DepthView& view, double time_s, std::uint64_t noise_seed,
                                  double warm_up = 0.0) const;

 private:
  struct Layers;
  void Cast(const World& world, std::span<const MovingPose> rows, int tile_row,
            const Layers& layers, cv::Mat& true_m, cv::Mat& incidence_cosine, cv::Mat& skin) const;
  void MeasureRow(int y, const Layers& layers, const cv::Mat& true_m,
                  const cv::Mat& incidence_cosine, std::uint64_t noise_seed,
                  const ClassDepth* other, cv::Mat& measured_m) const;
  void CastShadow(int y, const cv::Mat& true_m, cv::Mat& measured_m) const;
  [[nodiscard]] float SlantAt(
      float cosine) const;  ///< NguyenSlant() by the cosine of the incidence.
  [[nodiscard]] cv::Mat Register(const cv::Mat& measured_m) const;

  /// Contribution of the projected pattern for a surface at depth z, unit variance.
  [[nodiscard]] double SpeckleAt(int x, int y, double z) const;
  /// Of structured light.
  [[nodiscard]] double WithSystematicErrors(int x, int y, double true_z, double warm_up) const;
  /// Relative error of the depth z at a pixel, in addition to scale, offset, bow and tilt.
  [[nodiscard]] double BendAt(std::size_t pixel, double z) const;

  SensorUnit unit_;
  PixelRays rays_;
  std::vector<float> bend_;         ///< Relative error of depth per pixel; may be empty.
  std::vector<float> bend_change_;  ///< Its change with depth.
  std::vector<float> speckle_;      ///< Unit variance, on the projector's grid; empty: none.
  std::vector<float> slants_;       ///< By the cosine, in equal steps.
  /// Rays used for the registration: the direction of each pixel in the colour camera's frame.
  std::vector<Eigen::Vector3f> assumed_rays_;
};

}  // namespace plumb::simulated
