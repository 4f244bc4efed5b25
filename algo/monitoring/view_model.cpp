// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/view_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

namespace plumb {
namespace {

using Eigen::Vector3f;

constexpr float kLeastCosine = 0.24F;  // 76 deg
constexpr int kNormalReach = 2;        // blocks
// Neighbours of one surface differ by less: 76 deg at 1 m over the reach.
constexpr float kSameSurface_m = 0.07F;

struct SeenVertex {
  float u = 0.0F, v = 0.0F, inverse_z = 0.0F;
};

// Fills the pixels whose centres lie inside the triangle; 1/z is linear in the image.
void Fill(const std::array<SeenVertex, 3>& t, cv::Mat& inverse) {
  const float area = (t[1].u - t[0].u) * (t[2].v - t[0].v) - (t[2].u - t[0].u) * (t[1].v - t[0].v);
  if (!(std::abs(area) > 1e-9F)) return;
  const auto [u_low, u_high] = std::minmax({t[0].u, t[1].u, t[2].u});
  const auto [v_low, v_high] = std::minmax({t[0].v, t[1].v, t[2].v});
  const int u0 = std::max(0, static_cast<int>(std::ceil(u_low)));
  const int v0 = std::max(0, static_cast<int>(std::ceil(v_low)));
  const int u1 = std::min(inverse.cols - 1, static_cast<int>(std::floor(u_high)));
  const int v1 = std::min(inverse.rows - 1, static_cast<int>(std::floor(v_high)));
  for (int v = v0; v <= v1; ++v) {
    auto* row = inverse.ptr<float>(v);
    for (int u = u0; u <= u1; ++u) {
      const float du = static_cast<float>(u) - t[0].u, dv = static_cast<float>(v) - t[0].v;
      const float b = (du * (t[2].v - t[0].v) - (t[2].u - t[0].u) * dv) / area;
      const float c = ((t[1].u - t[0].u) * dv - du * (t[1].v - t[0].v)) / area;
      if (b < -1e-4F || c < -1e-4F || b + c > 1.0001F) continue;
      const float w = t[0].inverse_z + b * (t[1].inverse_z - t[0].inverse_z) +
                      c * (t[2].inverse_z - t[0].inverse_z);
      row[u] = std::max(row[u], w);
    }
  }
}

// Difference of the points on either side of a block, at the largest reach that stays on one
// surface.
std::optional<Vector3f> Slope(const std::vector<Vector3f>& points, const BlockImage& seen,
                              std::size_t block, int position, int limit, std::size_t stride) {
  for (int reach = kNormalReach; reach >= 1; --reach) {
    if (position < reach || position + reach >= limit) continue;
    const std::size_t step = static_cast<std::size_t>(reach) * stride;
    const std::size_t before = block - step, after = block + step;
    if (seen.inverse_depth[before] <= 0 || seen.inverse_depth[after] <= 0) continue;
    const float z = points[block].z();
    const float limit_m = 0.5F * kSameSurface_m * static_cast<float>(reach);
    if (std::abs(points[before].z() - z) > limit_m || std::abs(points[after].z() - z) > limit_m)
      continue;
    return points[after] - points[before];
  }
  return std::nullopt;
}

}  // namespace

std::size_t ViewModel::CountOf(SurfacePart wanted) const {
  return static_cast<std::size_t>(std::count(part.begin(), part.end(), wanted));
}

cv::Mat RenderDepth(const TriangleMesh& mesh, const Pose& T_camera_mesh, const Intrinsics& camera) {
  std::vector<SeenVertex> seen(mesh.vertices.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Eigen::Vector3d p = T_camera_mesh * mesh.vertices[i].cast<double>();
    // Far beside the image the lens model may fold back.
    if (!(p.z() > 0.1) || std::abs(p.x()) > 1.5 * p.z() || std::abs(p.y()) > 1.5 * p.z()) continue;
    const Eigen::Vector2f pixel = Project(camera, p).cast<float>();
    seen[i] = {pixel.x(), pixel.y(), static_cast<float>(1.0 / p.z())};
  }
  cv::Mat depth(camera.height, camera.width, CV_32FC1, cv::Scalar(0));
  for (const auto& triangle : mesh.triangles) {
    const std::array<SeenVertex, 3> corners{seen[triangle[0]], seen[triangle[1]],
                                            seen[triangle[2]]};
    if (corners[0].inverse_z > 0 && corners[1].inverse_z > 0 && corners[2].inverse_z > 0)
      Fill(corners, depth);
  }
  for (int v = 0; v < depth.rows; ++v) {
    auto* row = depth.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) row[u] = row[u] > 0 ? 1.0F / row[u] : 0.0F;
  }
  return depth;
}

ViewModel MakeViewModel(const BlockImage& seen, const BlockGrid& grid, const Pose& T_scene_camera,
                        const DepthNoise& noise,
                        const std::function<SurfacePart(const Eigen::Vector3d&)>& part_of) {
  const std::size_t size = grid.size();
  std::vector<Vector3f> points(size, Vector3f::Zero());
  for (std::size_t i = 0; i < size; ++i) {
    if (seen.inverse_depth[i] > 0) points[i] = seen.Point(i);
  }
  ViewModel model{.point = std::vector<Vector3f>(size, Vector3f::Zero()),
                  .normal = std::vector<Vector3f>(size, Vector3f::UnitZ()),
                  .inverse_depth = std::vector<float>(size, 0.0F),
                  .sigma_m = std::vector<float>(size, 1.0F),
                  .part = std::vector<SurfacePart>(size, SurfacePart::kNone)};
  const Eigen::Matrix3f R_scene_camera = T_scene_camera.linear().cast<float>();
  for (std::size_t i = 0; i < size; ++i) {
    if (seen.inverse_depth[i] <= 0) continue;
    const int column = static_cast<int>(i) % grid.columns, row = static_cast<int>(i) / grid.columns;
    const auto across = Slope(points, seen, i, column, grid.columns, 1);
    const auto down =
        Slope(points, seen, i, row, grid.rows, static_cast<std::size_t>(grid.columns));
    if (!across || !down) continue;
    Vector3f normal = across->cross(*down).normalized();
    if (normal.dot(points[i]) > 0) normal = -normal;
    const float cosine = -normal.dot(points[i].normalized());
    if (!(cosine > kLeastCosine)) continue;
    const Eigen::Vector3d p = T_scene_camera * points[i].cast<double>();
    const float angle = std::acos(std::min(cosine, 1.0F));
    const float grazing = angle / ((0.5F * std::numbers::pi_v<float>)-angle);
    model.point[i] = p.cast<float>();
    model.normal[i] = R_scene_camera * normal;
    model.inverse_depth[i] = seen.inverse_depth[i];
    model.sigma_m[i] = noise.Sigma_m(points[i].z(), grazing) * cosine;
    model.part[i] = part_of(p);
  }
  return model;
}

}  // namespace plumb
