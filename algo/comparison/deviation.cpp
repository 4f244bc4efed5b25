// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/deviation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace plumb {
namespace {

constexpr float kMaxJump_m =
    0.01F;  // height step between neighbouring cells; a larger one separates two surfaces
constexpr float kSheet_m = 0.01F;  // thickness of a cloud's top surface
constexpr float kMaxRimRatio =
    0.5F;  // lateral over axial distance; allows for a noisy normal at the rim of a pinhole
constexpr int kMaxDescent = 200;  // steps of the local search, one cell each
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

void CheckGrids(const HeightMap& current, const HeightMap& reference) {
  if (current.grid == reference.grid && current.z.size() == reference.z.size() &&
      current.z.size() == current.grid.num_cells())
    return;
  throw std::invalid_argument("height maps must share one grid");
}

// Draws triangles into a height map in its own cell coordinates (column, row) and keeps the
// highest.
class TriangleCanvas {
 public:
  explicit TriangleCanvas(const GridShape& grid) : map_(grid) {}

  // Vertices: x and y in cells (the centre of cell 0 is at 0), z in metres.
  void Draw(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
    const double area = (b.x() - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (b.y() - a.y());
    if (!(std::abs(area) > 1e-12)) return;
    const double x_low = std::max(std::min({a.x(), b.x(), c.x()}), 0.0);
    const double x_high = std::min(std::max({a.x(), b.x(), c.x()}), map_.grid.width - 1.0);
    const double y_low = std::max(std::min({a.y(), b.y(), c.y()}), 0.0);
    const double y_high = std::min(std::max({a.y(), b.y(), c.y()}), map_.grid.height - 1.0);
    for (int row = static_cast<int>(std::ceil(y_low)); row <= y_high; ++row) {
      for (int column = static_cast<int>(std::ceil(x_low)); column <= x_high; ++column) {
        const double v =
            ((column - a.x()) * (c.y() - a.y()) - (c.x() - a.x()) * (row - a.y())) / area;
        const double w =
            ((b.x() - a.x()) * (row - a.y()) - (column - a.x()) * (b.y() - a.y())) / area;
        // cells on a shared edge belong to both triangles, so that no pinholes appear
        constexpr double kEdge = -1e-9;
        if (v < kEdge || w < kEdge || v + w > 1.0 - kEdge) continue;
        const float z = static_cast<float>(a.z() + v * (b.z() - a.z()) + w * (c.z() - a.z()));
        float& cell = map_.at(row, column);
        if (!(cell >= z)) cell = z;
      }
    }
  }

  [[nodiscard]] HeightMap Take() { return std::move(map_); }

 private:
  HeightMap map_;
};

bool Connected(float a, float b, float c) {
  return std::max({a, b, c}) - std::min({a, b, c}) < kMaxJump_m;
}

// Position and normal of a cell of the current surface, for the distance search.
class GridSurface {
 public:
  explicit GridSurface(const HeightMap& map)
      : map_(map), step_(static_cast<float>(map.grid.step)) {}

  [[nodiscard]] Eigen::Vector3f Normal(int row, int column) const {
    return Eigen::Vector3f(-Slope(row, column, 0, 1), -Slope(row, column, 1, 0), 1.0F).normalized();
  }
  // True at the end of the surface: a neighbour is unknown or outside the grid.
  [[nodiscard]] bool OnRim(int row, int column) const {
    for (int r = row - 1; r <= row + 1; ++r) {
      for (int c = column - 1; c <= column + 1; ++c) {
        if (!map_.grid.contains(r, c) || !std::isfinite(map_.at(r, c))) return true;
      }
    }
    return false;
  }

 private:
  [[nodiscard]] float Value(int row, int column) const {
    return map_.grid.contains(row, column) ? map_.at(row, column)
                                           : std::numeric_limits<float>::quiet_NaN();
  }
  // Slope in one direction: central difference, or one-sided at an end or beside a jump.
  [[nodiscard]] float Slope(int row, int column, int dr, int dc) const {
    const float here = map_.at(row, column);
    const float ahead = Value(row + dr, column + dc) - here;
    const float behind = here - Value(row - dr, column - dc);
    const bool use_ahead = std::abs(ahead) < kMaxJump_m;
    const bool use_behind = std::abs(behind) < kMaxJump_m;
    if (use_ahead && use_behind) return 0.5F * (ahead + behind) / step_;
    if (use_ahead) return ahead / step_;
    return use_behind ? behind / step_ : 0.0F;
  }

  const HeightMap& map_;
  float step_;
};

// Nearest cell of the current surface for every reference cell, found by propagating candidates
// between neighbours.
class NearestCells {
 public:
  NearestCells(const HeightMap& current, const HeightMap& reference,
               const std::vector<std::uint8_t>& mask)
      : current_(current),
        reference_(reference),
        width_(current.grid.width),
        height_(current.grid.height),
        step_(static_cast<float>(current.grid.step)),
        best_(current.z.size(), kNone),
        squared_(current.z.size(), std::numeric_limits<float>::max()),
        wanted_(current.z.size(), 0),
        settled_(current.z.size(), 0) {
    for (std::size_t i = 0; i < best_.size(); ++i) {
      wanted_[i] = std::isfinite(reference.z[i]) && (mask.empty() || mask[i] != 0) ? 1 : 0;
      if (wanted_[i] != 0 && std::isfinite(current.z[i])) {
        const float dz = current.z[i] - reference.z[i];
        best_[i] = static_cast<std::uint32_t>(i);
        squared_[i] = dz * dz;
        // Closer than one cell: no other column can hold a nearer point, and the tangent plane here
        // is accurate enough.
        settled_[i] = std::abs(dz) < step_ ? 1 : 0;
      }
    }
    for (int pass = 0; pass < 2; ++pass) {
      Sweep(1);
      Sweep(-1);
    }
    for (std::size_t i = 0; i < best_.size(); ++i) Descend(i);
  }

  [[nodiscard]] std::uint32_t of(std::size_t cell) const { return best_[cell]; }

 private:
  void Try(std::size_t cell, int row, int column, int other_row, int other_column) {
    if (!current_.grid.contains(other_row, other_column)) return;
    const std::size_t other = current_.grid.index(other_row, other_column);
    const float z = current_.z[other];
    if (!std::isfinite(z)) return;
    const float dx = static_cast<float>(other_column - column) * step_;
    const float dy = static_cast<float>(other_row - row) * step_;
    const float dz = z - reference_.z[cell];
    const float squared = dx * dx + dy * dy + dz * dz;
    if (squared >= squared_[cell]) return;
    squared_[cell] = squared;
    best_[cell] = static_cast<std::uint32_t>(other);
  }

  void Sweep(int direction) {
    const int first_row = direction > 0 ? 0 : height_ - 1;
    const int first_column = direction > 0 ? 0 : width_ - 1;
    const std::array<std::array<int, 2>, 4> behind = {
        {{0, -direction}, {-direction, -direction}, {-direction, 0}, {-direction, direction}}};
    for (int row = first_row; row >= 0 && row < height_; row += direction) {
      for (int column = first_column; column >= 0 && column < width_; column += direction) {
        const std::size_t cell = current_.grid.index(row, column);
        if (wanted_[cell] == 0 || settled_[cell] != 0) continue;
        for (const auto& [dr, dc] : behind) {
          const int r = row + dr;
          const int c = column + dc;
          if (!current_.grid.contains(r, c)) continue;
          const std::uint32_t candidate = best_[current_.grid.index(r, c)];
          if (candidate == kNone) continue;
          const int candidate_row = static_cast<int>(candidate) / width_;
          const int candidate_column = static_cast<int>(candidate) % width_;
          Try(cell, row, column, candidate_row, candidate_column);
          Try(cell, row, column, candidate_row - dr, candidate_column - dc);
        }
      }
    }
  }

  void Descend(std::size_t cell) {
    if (best_[cell] == kNone || settled_[cell] != 0) return;
    const int row = static_cast<int>(cell) / width_;
    const int column = static_cast<int>(cell) % width_;
    for (int step = 0; step < kMaxDescent; ++step) {
      const std::uint32_t before = best_[cell];
      const int r = static_cast<int>(before) / width_;
      const int c = static_cast<int>(before) % width_;
      for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) Try(cell, row, column, r + dr, c + dc);
      }
      if (best_[cell] == before) return;
    }
  }

  const HeightMap& current_;
  const HeightMap& reference_;
  int width_;
  int height_;
  float step_;
  std::vector<std::uint32_t> best_;
  std::vector<float> squared_;
  std::vector<std::uint8_t> wanted_;
  std::vector<std::uint8_t> settled_;
};

}  // namespace

HeightMap ResampledHeightMap(const HeightMap& source, const Eigen::Affine3d& T_target_source,
                             const GridShape& target) {
  TriangleCanvas canvas(target);
  const int width = source.grid.width;
  std::vector<Eigen::Vector3d> above(static_cast<std::size_t>(std::max(width, 0)));
  std::vector<Eigen::Vector3d> below = above;
  const Eigen::Vector3d to_cells(1.0 / target.step, 1.0 / target.step, 1.0);
  const Eigen::Vector3d origin(target.x_centre(0), target.y_centre(0), 0.0);
  for (int row = 0; row < source.grid.height; ++row) {
    std::swap(above, below);
    for (int column = 0; column < width; ++column) {
      const float z = source.at(row, column);
      if (!std::isfinite(z)) continue;
      const Eigen::Vector3d p = T_target_source * Eigen::Vector3d(source.grid.x_centre(column),
                                                                  source.grid.y_centre(row), z);
      below[static_cast<std::size_t>(column)] = (p - origin).cwiseProduct(to_cells);
    }
    for (int column = 0; row > 0 && column + 1 < width; ++column) {
      const std::size_t c = static_cast<std::size_t>(column);
      const float z00 = source.at(row - 1, column);
      const float z01 = source.at(row - 1, column + 1);
      const float z10 = source.at(row, column);
      const float z11 = source.at(row, column + 1);
      // Two triangles along the diagonal 00-11; where a corner is missing, one triangle of the
      // other three. Edges to NaN are never drawn.
      const bool upper = Connected(z00, z01, z11) && std::isfinite(z00 + z01 + z11);
      const bool lower = Connected(z00, z11, z10) && std::isfinite(z00 + z11 + z10);
      if (upper) canvas.Draw(above[c], above[c + 1], below[c + 1]);
      if (lower) canvas.Draw(above[c], below[c + 1], below[c]);
      if (upper || lower) continue;
      if (std::isfinite(z00 + z01 + z10) && Connected(z00, z01, z10))
        canvas.Draw(above[c], above[c + 1], below[c]);
      if (std::isfinite(z01 + z11 + z10) && Connected(z01, z11, z10))
        canvas.Draw(above[c + 1], below[c + 1], below[c]);
    }
  }
  return canvas.Take();
}

HeightMap HeightMapOfCloud(const PointCloud& cloud_in_target, double reach_m,
                           const GridShape& target) {
  constexpr float kMinUp = 0.2F;  // steeper discs are not visible from above
  HeightMap top(target);
  std::vector<float> sum(target.num_cells(), 0.0F);
  std::vector<float> weight(target.num_cells(), 0.0F);
  const auto for_disc = [&](std::size_t i, auto&& visit) {
    const Eigen::Vector3f& p = cloud_in_target.points[i];
    const Eigen::Vector3f& n = cloud_in_target.normals[i];
    if (!p.allFinite() || !(n.z() > kMinUp)) return;
    const double column_at = (p.x() - target.x_min) / target.step - 0.5;
    const double row_at = (p.y() - target.y_min) / target.step - 0.5;
    const double reach = reach_m / target.step;
    if (!(column_at > -reach && column_at < target.width + reach && row_at > -reach &&
          row_at < target.height + reach))
      return;
    for (int row = std::max(static_cast<int>(std::ceil(row_at - reach)), 0);
         row <= std::min(row_at + reach, target.height - 1.0); ++row) {
      for (int column = std::max(static_cast<int>(std::ceil(column_at - reach)), 0);
           column <= std::min(column_at + reach, target.width - 1.0); ++column) {
        const float dx = static_cast<float>((column - column_at) * target.step);
        const float dy = static_cast<float>((row - row_at) * target.step);
        const float far = (dx * dx + dy * dy) / static_cast<float>(reach_m * reach_m);
        if (far >= 1.0F) continue;
        visit(target.index(row, column), p.z() - (n.x() * dx + n.y() * dy) / n.z(),
              (1 - far) * (1 - far) + 1e-3F);
      }
    }
  };
  for (std::size_t i = 0; i < cloud_in_target.size(); ++i) {
    for_disc(i, [&](std::size_t cell, float z, float) {
      if (!(top.z[cell] >= z)) top.z[cell] = z;
    });
  }
  for (std::size_t i = 0; i < cloud_in_target.size(); ++i) {
    for_disc(i, [&](std::size_t cell, float z, float w) {
      if (z < top.z[cell] - kSheet_m) return;
      sum[cell] += w * z;
      weight[cell] += w;
    });
  }
  for (std::size_t cell = 0; cell < sum.size(); ++cell) {
    if (weight[cell] > 0) top.z[cell] = sum[cell] / weight[cell];
  }
  return top;
}

HeightMap HeightDifference(const HeightMap& current, const HeightMap& reference) {
  CheckGrids(current, reference);
  HeightMap difference(reference.grid);
  for (std::size_t i = 0; i < difference.z.size(); ++i)
    difference.z[i] = current.z[i] - reference.z[i];
  return difference;
}

HeightMap SignedDistance(const HeightMap& current, const HeightMap& reference,
                         const std::vector<std::uint8_t>& mask) {
  CheckGrids(current, reference);
  if (!mask.empty() && mask.size() != reference.z.size())
    throw std::invalid_argument("the mask must have one entry per cell");
  HeightMap distance(reference.grid);
  const NearestCells nearest(current, reference, mask);
  const GridSurface surface(current);
  const int width = reference.grid.width;
  const float step = static_cast<float>(reference.grid.step);
  for (std::size_t cell = 0; cell < distance.z.size(); ++cell) {
    const std::uint32_t best = nearest.of(cell);
    if (best == kNone) continue;
    const int row = static_cast<int>(best) / width;
    const int column = static_cast<int>(best) % width;
    const Eigen::Vector3f offset(static_cast<float>(static_cast<int>(cell) % width - column) * step,
                                 static_cast<float>(static_cast<int>(cell) / width - row) * step,
                                 reference.z[cell] - current.z[best]);
    const Eigen::Vector3f normal = surface.Normal(row, column);
    const float along = normal.dot(offset);
    const float sideways = (offset - along * normal).norm();
    // Within a cell's own patch of surface the tangent plane represents the surface; beyond it the
    // nearest point lies on a crease or an end.
    if (sideways < 1.5F * step / std::max(normal.z(), 0.1F)) {
      distance.z[cell] = -along;
    } else if (sideways < kMaxRimRatio * std::abs(along) || !surface.OnRim(row, column)) {
      distance.z[cell] = along < 0 ? offset.norm() : -offset.norm();
    }
  }
  return distance;
}

}  // namespace plumb
