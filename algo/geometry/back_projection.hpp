// SPDX-License-Identifier: Apache-2.0
// Converts depth images to points with precomputed viewing rays of the camera.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "algo/base/intrinsics.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Ideal normalised coordinates (x/z, y/z) of every pixel centre; the point of a pixel is z * (x,
/// y, 1). Immutable after construction, so threads may share it.
class RayTable {
 public:
  /// @throws std::invalid_argument if the size is not in [1, 16384] or a focal length is not
  /// positive and finite.
  explicit RayTable(const Intrinsics& intrinsics);

  [[nodiscard]] const Intrinsics& intrinsics() const { return intrinsics_; }
  [[nodiscard]] int width() const { return intrinsics_.width; }
  [[nodiscard]] int height() const { return intrinsics_.height; }
  [[nodiscard]] const Eigen::Vector2f& ideal(int row, int column) const {
    return this->row(row)[column];
  }
  /// The rays of one image row, width() of them.
  [[nodiscard]] const Eigen::Vector2f* row(int row) const {
    return ideal_.data() +
           static_cast<std::size_t>(row) * static_cast<std::size_t>(intrinsics_.width);
  }

 private:
  Intrinsics intrinsics_;
  std::vector<Eigen::Vector2f> ideal_;
};

/// Keeps one table per camera, for callers with many images from few cameras. Not thread-safe: get
/// the tables first, then share them among threads.
class RayTables {
 public:
  /// @throws std::invalid_argument as RayTable's constructor.
  [[nodiscard]] std::shared_ptr<const RayTable> For(const Intrinsics& intrinsics);

 private:
  std::vector<std::shared_ptr<const RayTable>> tables_;
};

/// All valid pixels of a depth image as points in the camera frame (paper: C_i^{j,0}, function Psi;
/// here with the lens corrected), row by row. Colours are added where the view has a colour image.
/// No normals.
/// @throws std::invalid_argument if the depth image is not CV_32FC1 or the images do not have the
///         table's size.
[[nodiscard]] PointCloud BackProject(const DepthView& view, const RayTable& rays);

}  // namespace plumb
