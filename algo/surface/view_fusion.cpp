// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/view_fusion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace plumb {
namespace {

constexpr float kBandSigmas = 4.0F;
constexpr float kMinCosIncidence =
    0.15F;                           // a view steeper than 81 deg to the seed's normal is not used
constexpr int kMaxViewSamples = 64;  // views averaged in one mean; more would not improve it

/// One view's measurement of the seed.
struct ViewSample {
  float distance_m;
  float weight;
};

/// Weighted mean with Tukey's weights about `centre`: smooth, with zero weight beyond the cut-off.
float TukeyMean(std::span<const ViewSample> samples, float centre, float cut, float& weight_sum) {
  float sum = 0.0F;
  weight_sum = 0.0F;
  for (const ViewSample& sample : samples) {
    const float ratio = (sample.distance_m - centre) / cut;
    const float inside = 1.0F - ratio * ratio;
    if (inside <= 0.0F) continue;
    const float weight = sample.weight * inside * inside;
    sum += weight * sample.distance_m;
    weight_sum += weight;
  }
  return weight_sum > 0.0F ? sum / weight_sum : centre;
}

}  // namespace

ViewFusion::ViewFusion(std::span<const ViewSurface> views, const FusionOptions& options)
    : options_(options) {
  cameras_.reserve(views.size());
  for (const ViewSurface& view : views) {
    Camera camera;
    camera.view = &view;
    const Pose T_camera_world = view.T_world_camera.inverse();
    camera.R_camera_world = T_camera_world.linear().cast<float>();
    camera.t_camera_world = T_camera_world.translation().cast<float>();
    const Intrinsics& k = view.intrinsics;
    camera.fx = static_cast<float>(k.fx);
    camera.fy = static_cast<float>(k.fy);
    camera.cx = static_cast<float>(k.cx);
    camera.cy = static_cast<float>(k.cy);
    camera.k1 = static_cast<float>(k.distortion[0]);
    camera.k2 = static_cast<float>(k.distortion[1]);
    camera.p1 = static_cast<float>(k.distortion[2]);
    camera.p2 = static_cast<float>(k.distortion[3]);
    camera.k3 = static_cast<float>(k.distortion[4]);
    camera.k4 = static_cast<float>(k.distortion[5]);
    camera.k5 = static_cast<float>(k.distortion[6]);
    camera.k6 = static_cast<float>(k.distortion[7]);
    camera.has_lens = HasLens(k);
    const Eigen::Vector2f* rays = view.rays->row(0);
    camera.ray_min = camera.ray_max = rays[0];
    float min_inverse = 0.0F;
    for (std::size_t i = 0; i < view.size(); ++i) {
      camera.ray_min = camera.ray_min.cwiseMin(rays[i]);
      camera.ray_max = camera.ray_max.cwiseMax(rays[i]);
      const ViewSurface::Pixel& pixel = view.pixels[i];
      if (pixel.weight > 0.0F && (min_inverse == 0.0F || pixel.inverse_depth < min_inverse))
        min_inverse = pixel.inverse_depth;
    }
    camera.max_depth_m = min_inverse > 0.0F ? 1.0F / min_inverse : 0.0F;
    camera.inward_sides = {Eigen::Vector3f(1, 0, -camera.ray_min.x()).normalized(),
                           Eigen::Vector3f(-1, 0, camera.ray_max.x()).normalized(),
                           Eigen::Vector3f(0, 1, -camera.ray_min.y()).normalized(),
                           Eigen::Vector3f(0, -1, camera.ray_max.y()).normalized()};
    cameras_.push_back(camera);
  }
}

void ViewFusion::ViewsNear(const Eigen::Vector3f& centre_world, float radius_m,
                           const Eigen::Vector3f& n_world,
                           std::vector<std::uint16_t>& found) const {
  found.clear();
  std::vector<std::pair<float, std::uint16_t>> rated;
  for (std::size_t i = 0; i < cameras_.size(); ++i) {
    const Camera& camera = cameras_[i];
    const Eigen::Vector3f p = camera.R_camera_world * centre_world + camera.t_camera_world;
    if (p.z() < -radius_m || p.z() - radius_m > camera.max_depth_m) continue;
    const bool outside =
        std::any_of(camera.inward_sides.begin(), camera.inward_sides.end(),
                    [&](const Eigen::Vector3f& side) { return side.dot(p) < -radius_m; });
    if (outside) continue;
    // Views that contain the ball's centre come before those that only touch the ball.
    const bool holds_centre =
        std::all_of(camera.inward_sides.begin(), camera.inward_sides.end(),
                    [&](const Eigen::Vector3f& side) { return side.dot(p) >= 0.0F; });
    const float distance = std::max(0.1F, p.norm());
    const float cos_incidence =
        std::max(0.0F, -n_world.dot(camera.R_camera_world.transpose() * p) / distance);
    const float sigma = camera.view->depth_noise.SigmaFacing_m(distance);
    rated.emplace_back((cos_incidence + (holds_centre ? 0.2F : 0.0F)) / (sigma * sigma),
                       static_cast<std::uint16_t>(i));
  }
  const std::size_t count =
      std::min(rated.size(), static_cast<std::size_t>(std::max(1, options_.max_views)));
  std::partial_sort(rated.begin(), rated.begin() + static_cast<std::ptrdiff_t>(count), rated.end(),
                    [](const auto& a, const auto& b) {
                      return a.first != b.first ? a.first > b.first : a.second < b.second;
                    });
  for (std::size_t k = 0; k < count; ++k) found.push_back(rated[k].second);
  std::sort(found.begin(), found.end());
}

bool ViewFusion::Project(std::uint16_t index, const Eigen::Vector3f& p_world, Seen& seen) const {
  const Camera& camera = cameras_[index];
  seen.p = camera.R_camera_world * p_world + camera.t_camera_world;
  if (seen.p.z() < 0.1F) return false;
  seen.inverse_z = 1.0F / seen.p.z();
  float x = seen.p.x() * seen.inverse_z;
  float y = seen.p.y() * seen.inverse_z;
  if (x < camera.ray_min.x() || x > camera.ray_max.x() || y < camera.ray_min.y() ||
      y > camera.ray_max.y())
    return false;
  if (camera.has_lens) {
    const float r2 = x * x + y * y;
    const float radial = (1.0F + r2 * (camera.k1 + r2 * (camera.k2 + r2 * camera.k3))) /
                         (1.0F + r2 * (camera.k4 + r2 * (camera.k5 + r2 * camera.k6)));
    const float xd = x * radial + 2.0F * camera.p1 * x * y + camera.p2 * (r2 + 2.0F * x * x);
    y = y * radial + camera.p1 * (r2 + 2.0F * y * y) + 2.0F * camera.p2 * x * y;
    x = xd;
  }
  const float u = camera.fx * x + camera.cx;
  const float v = camera.fy * y + camera.cy;
  if (!(u >= 0.0F && v >= 0.0F)) return false;
  const int column = static_cast<int>(u);
  const int row = static_cast<int>(v);
  if (column + 1 >= camera.view->width() || row + 1 >= camera.view->height()) return false;
  seen.fu = u - static_cast<float>(column);
  seen.fv = v - static_cast<float>(row);
  seen.top_left =
      static_cast<std::uint32_t>(row) * static_cast<std::uint32_t>(camera.view->width()) +
      static_cast<std::uint32_t>(column);
  seen.index = index;
  return true;
}

bool ViewFusion::Measure(const Seen& seen, const Eigen::Vector3f& n_world,
                         Measured& measured) const {
  const Camera& camera = cameras_[seen.index];
  const ViewSurface::Pixel* top = camera.view->pixels.data() + seen.top_left;
  const ViewSurface::Pixel* bottom = top + static_cast<std::size_t>(camera.view->width());
  if (top[0].weight <= 0.0F || top[1].weight <= 0.0F || bottom[0].weight <= 0.0F ||
      bottom[1].weight <= 0.0F)
    return false;
  const Eigen::Vector3f n = camera.R_camera_world * n_world;
  const float along = -n.dot(seen.p);  // |p| times the cosine of the angle of incidence
  if (along * along < kMinCosIncidence * kMinCosIncidence * seen.p.squaredNorm() || along < 0.0F)
    return false;
  const float above =
      top[0].inverse_depth + seen.fu * (top[1].inverse_depth - top[0].inverse_depth);
  const float below =
      bottom[0].inverse_depth + seen.fu * (bottom[1].inverse_depth - bottom[0].inverse_depth);
  const float depth = 1.0F / (above + seen.fv * (below - above));
  // The measured point lies on the seed's own ray, beyond it by this fraction of its length.
  measured.beyond = depth * seen.inverse_z - 1.0F;
  measured.distance_m = -measured.beyond * along;
  return true;
}

std::optional<float> ViewFusion::Distance(std::size_t view, const Eigen::Vector3f& p_world,
                                          const Eigen::Vector3f& n_world) const {
  Seen seen;
  Measured measured;
  if (!Project(static_cast<std::uint16_t>(view), p_world, seen) ||
      !Measure(seen, n_world, measured))
    return std::nullopt;
  return measured.distance_m;
}

FusedPoint ViewFusion::Fuse(const Eigen::Vector3f& p_world, const Eigen::Vector3f& n_world,
                            std::span<const std::uint16_t> candidates) const {
  FusedPoint fused;
  std::array<ViewSample, kMaxViewSamples> samples;
  std::size_t num_samples = 0;
  float best_weight = 0.0F;
  float widest_band = options_.min_band_m;
  // In groups: the pixels of a group's views come from memory while the others are projected.
  constexpr std::size_t kGroup = 16;
  std::array<Seen, kGroup> group;
  for (std::size_t first = 0; first < candidates.size(); first += kGroup) {
    std::size_t num_seen = 0;
    for (const std::uint16_t candidate :
         candidates.subspan(first, std::min(kGroup, candidates.size() - first))) {
      if (!Project(candidate, p_world, group[num_seen])) continue;
      const ViewSurface& view = *cameras_[candidate].view;
      const std::size_t i = group[num_seen++].top_left;
      __builtin_prefetch(view.pixels.data() + i);
      __builtin_prefetch(view.pixels.data() + i + static_cast<std::size_t>(view.width()));
    }
    for (std::size_t k = 0; k < num_seen; ++k) {
      const std::uint16_t index = group[k].index;
      const ViewSurface& view = *cameras_[index].view;
      Measured measured;
      if (!Measure(group[k], n_world, measured)) continue;
      const auto& [distance, beyond] = measured;
      const Eigen::Vector3f& p = group[k].p;
      const float band =
          std::max(options_.min_band_m, kBandSigmas * view.depth_noise.SigmaFacing_m(p.z()));
      if (std::abs(distance) > band) {
        if (beyond * p.z() > options_.see_through_m) ++fused.num_through;
        continue;
      }
      if (num_samples == kMaxViewSamples) continue;
      const std::size_t nearest =
          group[k].top_left + (group[k].fu > 0.5F ? 1U : 0U) +
          (group[k].fv > 0.5F ? static_cast<std::size_t>(view.width()) : 0U);
      const float w = view.pixels[nearest].weight;
      samples[num_samples++] = {distance, w};
      widest_band = std::max(widest_band, band);
      const Eigen::Matrix3f& R = cameras_[index].R_camera_world;
      if (options_.with_normals) fused.normal += w * (R.transpose() * view.normals[nearest].Unit());
      if (w > best_weight) {
        best_weight = w;
        fused.best_view = index;
        fused.best_pixel = static_cast<std::uint32_t>(nearest);
      }
    }
  }
  fused.num_agreeing = static_cast<int>(num_samples);
  if (num_samples == 0) return fused;
  const std::span<const ViewSample> used(samples.data(), num_samples);
  // First with the whole band about the seed, then about the result, so that an outlier near the
  // end of the band loses its influence.
  fused.offset_m = TukeyMean(used, 0.0F, 1.5F * widest_band, fused.weight);
  fused.offset_m = TukeyMean(used, fused.offset_m, widest_band, fused.weight);
  const float length = fused.normal.norm();
  fused.normal = length > 0.0F ? Eigen::Vector3f(fused.normal / length) : n_world;
  return fused;
}

}  // namespace plumb
