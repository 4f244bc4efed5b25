// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/surface_mesh.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <Eigen/Geometry>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr std::uint32_t kNoVertex = 0xFFFFFFFFU;
// Triangles with a steeper edge are steps between surfaces and are left out.
constexpr double kMaxSlope_deg = 80.0;
constexpr double kStepMargin_m = 0.003;  // what noise may add to an edge of that slope

/// Builds the mesh row by row; a vertex is created by the first triangle that uses it.
class GridMesher {
 public:
  GridMesher(const HeightMap& map, std::span<const Color> colors, const SurfaceMeshOptions& options)
      : map_(map), colors_(colors), decimation_(options.decimation) {
    const double run = map.grid.step * options.decimation;
    const double slope = std::tan(kMaxSlope_deg * kDegree);
    max_step_ = static_cast<float>(run * slope + kStepMargin_m);
    max_diagonal_step_ = static_cast<float>(std::sqrt(2.0) * run * slope + kStepMargin_m);
    columns_ = (map.grid.width + decimation_ - 1) / decimation_;
    rows_ = (map.grid.height + decimation_ - 1) / decimation_;
    vertex_of_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_),
                      kNoVertex);
  }

  TriangleMesh Build() {
    for (int row = 0; row + 1 < rows_; ++row)
      for (int column = 0; column + 1 < columns_; ++column) AddSquare(row, column);
    for (Eigen::Vector3f& normal : mesh_.normals) {
      const float length = normal.norm();
      normal = length > 0.0F ? Eigen::Vector3f(normal / length) : Eigen::Vector3f::UnitZ();
    }
    return std::move(mesh_);
  }

 private:
  struct Node {
    int row, column;
  };

  [[nodiscard]] float Z(const Node& node) const {
    return map_.at(node.row * decimation_, node.column * decimation_);
  }

  /// NaN fails every comparison, so missing corners need no separate test.
  [[nodiscard]] bool IsSurface(const Node& a, const Node& b, const Node& c) const {
    const auto joined = [&](const Node& p, const Node& q) {
      const bool is_diagonal = p.row != q.row && p.column != q.column;
      return std::abs(Z(p) - Z(q)) <= (is_diagonal ? max_diagonal_step_ : max_step_);
    };
    return joined(a, b) && joined(b, c) && joined(c, a);
  }

  void AddSquare(int row, int column) {
    const Node p00{row, column}, p01{row, column + 1}, p10{row + 1, column},
        p11{row + 1, column + 1};
    // The diagonal with the smaller step follows ridges better. If it lacks a corner, the other one
    // is used.
    const float falling = std::abs(Z(p00) - Z(p11));
    const float rising = std::abs(Z(p01) - Z(p10));
    if (falling <= rising || std::isnan(rising)) {
      if (IsSurface(p00, p01, p11)) AddTriangle(p00, p01, p11);
      if (IsSurface(p00, p11, p10)) AddTriangle(p00, p11, p10);
    } else {
      if (IsSurface(p00, p01, p10)) AddTriangle(p00, p01, p10);
      if (IsSurface(p01, p11, p10)) AddTriangle(p01, p11, p10);
    }
  }

  std::uint32_t Vertex(const Node& node) {
    std::uint32_t& index =
        vertex_of_[static_cast<std::size_t>(node.row) * static_cast<std::size_t>(columns_) +
                   static_cast<std::size_t>(node.column)];
    if (index != kNoVertex) return index;
    index = static_cast<std::uint32_t>(mesh_.vertices.size());
    const int row = node.row * decimation_;
    const int column = node.column * decimation_;
    mesh_.vertices.emplace_back(static_cast<float>(map_.grid.x_centre(column)),
                                static_cast<float>(map_.grid.y_centre(row)), Z(node));
    mesh_.normals.emplace_back(Eigen::Vector3f::Zero());
    if (!colors_.empty()) mesh_.colors.push_back(colors_[map_.grid.index(row, column)]);
    return index;
  }

  void AddTriangle(const Node& a, const Node& b, const Node& c) {
    const std::array<std::uint32_t, 3> triangle = {Vertex(a), Vertex(b), Vertex(c)};
    const Eigen::Vector3f& origin = mesh_.vertices[triangle[0]];
    const Eigen::Vector3f area =
        (mesh_.vertices[triangle[1]] - origin).cross(mesh_.vertices[triangle[2]] - origin);
    for (const std::uint32_t vertex : triangle) mesh_.normals[vertex] += area;
    mesh_.triangles.push_back(triangle);
  }

  const HeightMap& map_;
  std::span<const Color> colors_;
  int decimation_;
  float max_step_ = 0.0F;
  float max_diagonal_step_ = 0.0F;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::uint32_t> vertex_of_;
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh MeshOfHeightMap(const HeightMap& map, std::span<const Color> colors,
                             const SurfaceMeshOptions& options) {
  if (options.decimation < 1) throw std::invalid_argument("surface mesh: decimation out of range");
  if (!colors.empty() && colors.size() != map.grid.num_cells())
    throw std::invalid_argument("surface mesh: the numbers of cells and colours differ");
  return GridMesher(map, colors, options).Build();
}

std::vector<Color> ColorsFromCloud(const HeightMap& map, const PointCloud& cloud, int decimation) {
  if (decimation < 1)
    throw std::invalid_argument("colours of a height map: decimation out of range");
  if (cloud.colors.empty() || cloud.colors.size() != cloud.points.size()) return {};
  const GridShape& grid = map.grid;
  std::vector<std::uint32_t> point_of(grid.num_cells(), kNoVertex);
  std::vector<float> distance(grid.num_cells(), std::numeric_limits<float>::max());
  constexpr int kReach = 2;
  const auto first_of = [&](int place) {
    return (std::max(0, place - kReach) + decimation - 1) / decimation * decimation;
  };
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3f& p = cloud.points[i];
    const auto cell = grid.cell(p.x(), p.y());
    if (!cell) continue;
    const int row = static_cast<int>(*cell / static_cast<std::size_t>(grid.width));
    const int column = static_cast<int>(*cell % static_cast<std::size_t>(grid.width));
    for (int r = first_of(row); r <= std::min(grid.height - 1, row + kReach); r += decimation) {
      for (int c = first_of(column); c <= std::min(grid.width - 1, column + kReach);
           c += decimation) {
        const std::size_t k = grid.index(r, c);
        if (std::isnan(map.z[k])) continue;
        // A cell's own points take precedence over those of its neighbours; among the points of one
        // cell the nearest in height is used.
        const float cells_away =
            static_cast<float>(std::max(std::abs(r - row), std::abs(c - column)));
        const float d = cells_away + std::min(std::abs(map.z[k] - p.z()), 0.999F);
        if (d < distance[k]) {
          distance[k] = d;
          point_of[k] = static_cast<std::uint32_t>(i);
        }
      }
    }
  }
  std::vector<Color> colors(grid.num_cells(), Color{0, 0, 0});
  for (std::size_t k = 0; k < colors.size(); ++k)
    if (point_of[k] != kNoVertex) colors[k] = cloud.colors[point_of[k]];
  return colors;
}

}  // namespace plumb
