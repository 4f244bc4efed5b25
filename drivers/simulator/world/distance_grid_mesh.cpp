// SPDX-License-Identifier: Apache-2.0
// The zero set of a distance grid as triangles: surface nets (one vertex in each cell that the
// surface crosses).
#include <array>
#include <limits>

#include "drivers/simulator/world/distance_grid.hpp"

namespace plumb::simulated {
namespace {

constexpr std::uint32_t kNoVertex = std::numeric_limits<std::uint32_t>::max();

}  // namespace

TriangleMesh DistanceGrid::Surface() const {
  TriangleMesh mesh;
  std::vector<std::uint32_t> vertex_of_cell(values_.size(), kNoVertex);
  const auto negative = [&](int x, int y, int z) { return values_[Index(x, y, z)] < 0; };

  for (int z = 0; z + 1 < size_.z(); ++z) {
    for (int y = 0; y + 1 < size_.y(); ++y) {
      for (int x = 0; x + 1 < size_.x(); ++x) {
        int inside = 0;
        for (int corner = 0; corner < 8; ++corner)
          inside += negative(x + (corner & 1), y + ((corner >> 1) & 1), z + (corner >> 2)) ? 1 : 0;
        if (inside == 0 || inside == 8) continue;
        // From the cell's centre along the gradient onto the zero set.
        Eigen::Vector3f p =
            box_.min() + (Eigen::Vector3f(x, y, z) + Eigen::Vector3f::Constant(0.5F)) * spacing_;
        for (int step = 0; step < 6; ++step) p -= Interpolate(p) * Normal(p);
        vertex_of_cell[Index(x, y, z)] = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.push_back(p);
        mesh.normals.push_back(Normal(p));
      }
    }
  }

  // Each grid edge that the surface crosses belongs to four cells: one quadrilateral, two
  // triangles.
  for (int z = 1; z + 1 < size_.z(); ++z) {
    for (int y = 1; y + 1 < size_.y(); ++y) {
      for (int x = 1; x + 1 < size_.x(); ++x) {
        for (int axis = 0; axis < 3; ++axis) {
          const Eigen::Vector3i along = Eigen::Vector3i::Unit(axis);
          const Eigen::Vector3i u = Eigen::Vector3i::Unit((axis + 1) % 3);
          const Eigen::Vector3i v = Eigen::Vector3i::Unit((axis + 2) % 3);
          const Eigen::Vector3i node(x, y, z);
          const Eigen::Vector3i end = node + along;
          const bool begin_inside = negative(x, y, z);
          if (begin_inside == negative(end.x(), end.y(), end.z())) continue;
          const auto cell = [&](const Eigen::Vector3i& n) {
            return vertex_of_cell[Index(n.x(), n.y(), n.z())];
          };
          std::array<std::uint32_t, 4> quad = {cell(node - u - v), cell(node - v), cell(node),
                                               cell(node - u)};
          if (!begin_inside) std::swap(quad[1], quad[3]);
          mesh.triangles.push_back({quad[0], quad[1], quad[2]});
          mesh.triangles.push_back({quad[0], quad[2], quad[3]});
        }
      }
    }
  }
  return mesh;
}

}  // namespace plumb::simulated
