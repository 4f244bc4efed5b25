// SPDX-License-Identifier: Apache-2.0
// Clouds and triangle meshes.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace plumb {

using Color = std::array<std::uint8_t, 3>;  ///< red, green, blue

/// Points with optional attributes: an attribute vector is either empty or as long as `points`.
struct PointCloud {
  std::vector<Eigen::Vector3f> points;   ///< Metres, in the frame stated by the owner's name.
  std::vector<Eigen::Vector3f> normals;  ///< Unit length, towards the sensor.
  std::vector<Color> colors;

  [[nodiscard]] std::size_t size() const { return points.size(); }
  [[nodiscard]] bool empty() const { return points.empty(); }
};

/// Triangle mesh, counter-clockwise seen from outside; colours are optional (empty or one per
/// vertex).
struct TriangleMesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Color> colors;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

}  // namespace plumb
