// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/distance_grid.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <tbb/parallel_for.h>

namespace plumb::simulated {
namespace {

// Solution of the eikonal equation at one node from its smallest neighbours along x, y and z (Zhao
// 2005).
float SolveEikonal(float a, float b, float c, float h) {
  if (a > b) std::swap(a, b);
  if (b > c) std::swap(b, c);
  if (a > b) std::swap(a, b);
  float u = a + h;
  if (u <= b) return u;
  u = 0.5F * (a + b + std::sqrt(2.0F * h * h - (a - b) * (a - b)));
  if (u <= c) return u;
  const float sum = a + b + c;
  return (sum + std::sqrt(std::max(0.0F, sum * sum - 3.0F * (a * a + b * b + c * c - h * h)))) /
         3.0F;
}

}  // namespace

DistanceGrid::DistanceGrid(const std::function<double(const Eigen::Vector3d&)>& implicit,
                           const Eigen::AlignedBox3d& box, double spacing)
    : spacing_(static_cast<float>(spacing)), inverse_spacing_(static_cast<float>(1.0 / spacing)) {
  if (!(spacing > 0) || box.isEmpty())
    throw std::invalid_argument("distance grid needs a box that is not empty and a spacing > 0");
  size_ = ((box.sizes() / spacing).array().ceil().cast<int>() + 1).matrix();
  const Eigen::Vector3f low = box.min().cast<float>();
  box_ = Eigen::AlignedBox3f(low, low + (size_.cast<float>() - Eigen::Vector3f::Ones()) * spacing_);
  last_ = size_.cast<float>() - Eigen::Vector3f::Constant(1.001F);
  row_ = Index(0, 1, 0);
  slice_ = Index(0, 0, 1);
  values_.resize(Index(0, 0, size_.z()));
  tbb::parallel_for(0, size_.z(), [&](int z) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int x = 0; x < size_.x(); ++x) {
        const Eigen::Vector3d p = box.min() + Eigen::Vector3d(x, y, z) * spacing;
        values_[Index(x, y, z)] = static_cast<float>(implicit(p));
      }
    }
  });
  PropagateDistances(NormaliseNearSurface());
  BuildShades();
}

DistanceGrid DistanceGrid::Between(const DistanceGrid& base, const DistanceGrid& shape_a, double a,
                                   const DistanceGrid& shape_b, double b) {
  if (base.size_ != shape_a.size_ || base.size_ != shape_b.size_)
    throw std::invalid_argument("distance grids of different boxes cannot be mixed");
  DistanceGrid grid = base;
  const auto of_a = static_cast<float>(a), of_b = static_cast<float>(b);
  for (std::size_t i = 0; i < grid.values_.size(); ++i) {
    grid.values_[i] += of_a * (shape_a.values_[i] - base.values_[i]) +
                       of_b * (shape_b.values_[i] - base.values_[i]);
  }
  grid.BuildShades();
  return grid;
}

std::vector<char> DistanceGrid::NormaliseNearSurface() {
  std::vector<char> fixed(values_.size(), 0);
  std::vector<float> distances = values_;
  tbb::parallel_for(1, size_.z() - 1, [&](int z) {
    for (int y = 1; y + 1 < size_.y(); ++y) {
      for (int x = 1; x + 1 < size_.x(); ++x) {
        const float centre = values_[Index(x, y, z)];
        const std::array<float, 6> around = {
            values_[Index(x - 1, y, z)], values_[Index(x + 1, y, z)], values_[Index(x, y - 1, z)],
            values_[Index(x, y + 1, z)], values_[Index(x, y, z - 1)], values_[Index(x, y, z + 1)]};
        if (std::none_of(around.begin(), around.end(),
                         [&](float v) { return (v < 0) != (centre < 0); }))
          continue;
        const Eigen::Vector3f gradient(around[1] - around[0], around[3] - around[2],
                                       around[5] - around[4]);
        const float slope = std::max(0.2F, gradient.norm() * 0.5F * inverse_spacing_);
        distances[Index(x, y, z)] = centre / slope;
        fixed[Index(x, y, z)] = 1;
      }
    }
  });
  values_.swap(distances);
  return fixed;
}

void DistanceGrid::PropagateDistances(const std::vector<char>& fixed) {
  std::vector<float> far(values_.size());
  for (std::size_t i = 0; i < far.size(); ++i) far[i] = fixed[i] != 0 ? std::abs(values_[i]) : 1e3F;
  const auto at = [&](int x, int y, int z) {
    const bool inside =
        x >= 0 && y >= 0 && z >= 0 && x < size_.x() && y < size_.y() && z < size_.z();
    return inside ? far[Index(x, y, z)] : 1e3F;
  };
  // Fast sweeping: eight passes, one per diagonal direction.
  for (int pass = 0; pass < 8; ++pass) {
    for (int k = 0; k < size_.z(); ++k) {
      const int z = (pass & 4) != 0 ? size_.z() - 1 - k : k;
      for (int j = 0; j < size_.y(); ++j) {
        const int y = (pass & 2) != 0 ? size_.y() - 1 - j : j;
        for (int i = 0; i < size_.x(); ++i) {
          const int x = (pass & 1) != 0 ? size_.x() - 1 - i : i;
          const std::size_t index = Index(x, y, z);
          if (fixed[index] != 0) continue;
          const float u = SolveEikonal(std::min(at(x - 1, y, z), at(x + 1, y, z)),
                                       std::min(at(x, y - 1, z), at(x, y + 1, z)),
                                       std::min(at(x, y, z - 1), at(x, y, z + 1)), spacing_);
          far[index] = std::min(far[index], u);
        }
      }
    }
  }
  for (std::size_t i = 0; i < far.size(); ++i) {
    if (fixed[i] == 0) values_[i] = values_[i] < 0 ? -far[i] : far[i];
  }
}

inline DistanceGrid::Place DistanceGrid::Locate(float gx, float gy, float gz) const {
  gx = std::clamp(gx, 0.0F, last_.x());
  gy = std::clamp(gy, 0.0F, last_.y());
  gz = std::clamp(gz, 0.0F, last_.z());
  const int x = static_cast<int>(gx);
  const int y = static_cast<int>(gy);
  const int z = static_cast<int>(gz);
  return {Index(x, y, z), gx - static_cast<float>(x), gy - static_cast<float>(y),
          gz - static_cast<float>(z)};
}

inline float DistanceGrid::ValueAt(const Place& at) const {
  const float* v = &values_[at.index];
  const float* w = v + slice_;
  const float v00 = v[0] + at.x * (v[1] - v[0]);
  const float v10 = v[row_] + at.x * (v[row_ + 1] - v[row_]);
  const float v01 = w[0] + at.x * (w[1] - w[0]);
  const float v11 = w[row_] + at.x * (w[row_ + 1] - w[row_]);
  const float v0 = v00 + at.y * (v10 - v00);
  const float v1 = v01 + at.y * (v11 - v01);
  return v0 + at.z * (v1 - v0);
}

float DistanceGrid::Interpolate(const Eigen::Vector3f& p) const {
  const Eigen::Vector3f g = (p - box_.min()) * inverse_spacing_;
  return ValueAt(Locate(g.x(), g.y(), g.z()));
}

Eigen::Vector3f DistanceGrid::GradientAtNode(int x, int y, int z) const {
  const auto slope = [&](int at, int size, const auto& value) {
    const int low = std::max(0, at - 1);
    const int high = std::min(size - 1, at + 1);
    return (value(high) - value(low)) * inverse_spacing_ / static_cast<float>(high - low);
  };
  return {slope(x, size_.x(), [&](int i) { return values_[Index(i, y, z)]; }),
          slope(y, size_.y(), [&](int i) { return values_[Index(x, i, z)]; }),
          slope(z, size_.z(), [&](int i) { return values_[Index(x, y, i)]; })};
}

void DistanceGrid::BuildShades() {
  // Nodes of the cells that the surface crosses, plus one layer of cells.
  const float near = 3.0F * spacing_;
  shade_of_node_.assign(values_.size(), 0);
  std::vector<Eigen::Vector3i> nodes;
  for (int z = 0; z < size_.z(); ++z) {
    for (int y = 0; y < size_.y(); ++y) {
      for (int x = 0; x < size_.x(); ++x) {
        if (std::abs(values_[Index(x, y, z)]) > near) continue;
        nodes.emplace_back(x, y, z);
        shade_of_node_[Index(x, y, z)] = static_cast<std::uint32_t>(nodes.size());
      }
    }
  }
  shades_.assign(nodes.size() + 1, Eigen::Vector4f(0, 0, 1, 1));
  tbb::parallel_for(std::size_t{0}, nodes.size(), [&](std::size_t i) {
    const Eigen::Vector3i& node = nodes[i];
    const Eigen::Vector3f gradient = GradientAtNode(node.x(), node.y(), node.z());
    const Eigen::Vector3f normal = gradient / std::max(1e-6F, gradient.norm());
    const Eigen::Vector3f p = box_.min() + node.cast<float>() * spacing_;
    const Eigen::Vector3f surface = p - values_[Index(node.x(), node.y(), node.z())] * normal;
    const float open_near = std::clamp(Distance(surface + 0.03F * normal) / 0.03F, 0.0F, 1.0F);
    const float open_far = std::clamp(Distance(surface + 0.10F * normal) / 0.10F, 0.0F, 1.0F);
    shades_[i + 1] = Eigen::Vector4f(normal.x(), normal.y(), normal.z(),
                                     0.35F + 0.25F * open_near + 0.4F * open_far);
  });
}

float DistanceGrid::Distance(const Eigen::Vector3f& p) const {
  const Eigen::Vector3f inside = p.cwiseMax(box_.min()).cwiseMin(box_.max());
  return Interpolate(inside) + (p - inside).norm();
}

Eigen::Vector4f DistanceGrid::Shade(const Eigen::Vector3f& p) const {
  const Eigen::Vector3f g = (p - box_.min()) * inverse_spacing_;
  const Place at = Locate(g.x(), g.y(), g.z());
  const auto edge = [&](std::size_t index) -> Eigen::Vector4f {
    const Eigen::Vector4f& a = shades_[shade_of_node_[index]];
    const Eigen::Vector4f& b = shades_[shade_of_node_[index + 1]];
    return a + at.x * (b - a);
  };
  const Eigen::Vector4f v00 = edge(at.index);
  const Eigen::Vector4f v01 = edge(at.index + slice_);
  const Eigen::Vector4f v0 = v00 + at.y * (edge(at.index + row_) - v00);
  const Eigen::Vector4f v1 = v01 + at.y * (edge(at.index + slice_ + row_) - v01);
  Eigen::Vector4f shade = v0 + at.z * (v1 - v0);
  shade.head<3>() /= std::max(1e-6F, shade.head<3>().norm());
  return shade;
}

float DistanceGrid::ConeStart(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                              float spread, float margin, float t_end) const {
  float t = 0;
  for (int step = 0; step < 100; ++step) {
    const float room = 0.9F * Distance(origin + t * direction) - spread * t - margin;
    if (room <= 0.002F) return t;
    t += room / (1.0F + spread);
    if (t >= t_end) return kInfinity;
  }
  return t;
}

}  // namespace plumb::simulated
