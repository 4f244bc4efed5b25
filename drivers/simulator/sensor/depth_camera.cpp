// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/depth_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>

#include <tbb/parallel_for.h>

#include "algo/base/units.hpp"
#include "drivers/simulator/sensor/noise_field.hpp"
#include "drivers/simulator/sensor/ps1080.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3f;

constexpr double kJitterFilterPx =
    1.5;  // At 640 pixels width; the jitter of neighbours is slightly correlated.
constexpr float kEdgeStep = 0.02F;  // Depth difference of neighbours that forms an edge, metres.
constexpr float kFlyingFraction = 0.15F;    // Fraction of edge pixels with a depth in between.
constexpr float kEdgeLossFraction = 0.45F;  // Fraction of edge pixels without depth.
constexpr float kGrazingBegin = static_cast<float>(74.0 * kDegree);  // Losses begin here
constexpr float kGrazingEnd = static_cast<float>(82.0 * kDegree);    // and are complete here.
constexpr float kSteepest = 1.3F;  // Radians; even steeper surfaces count as edges.
constexpr int kSlantSteps = 2048;
constexpr double kProjectorBaseline_m = 0.075;
constexpr double kBendMiddle_m = 0.9;  // Middle of the depths of a sweep,
// and the distance from it over which half of the change happens.
constexpr double kBendReach_m = 0.4;

// Fraction of the beams that a surface with this incidence loses, by the cosine.
float GrazingLoss(float cosine) {
  static const float kBegin = std::cos(kGrazingBegin);
  if (cosine >= kBegin) return 0.0F;
  return std::min((std::acos(cosine) - kGrazingBegin) / (kGrazingEnd - kGrazingBegin), 1.0F);
}

float TangentOf(float cosine) {
  static const float kLeast = std::cos(kSteepest);
  const float c = std::max(cosine, kLeast);
  return std::sqrt(1.0F - c * c) / c;
}

// Cosines of the angles between rays and the normals where they hit.
Float4 IncidenceCosine(const World& world, const Ray4& rays, const Hit4& hits) {
  Float4 cosine = -rays.direction.z;  // Of the support.
  if (Any(hits.material > kSupport)) {
    const Vector3x4 places = hits.t * rays.direction + rays.origin;
    for (int i = 0; i < 4; ++i) {
      if (hits.material[i] > kSupport)
        cosine[i] = -world.Normal(static_cast<Material>(hits.material[i]), Lane(places, i))
                         .dot(Lane(rays.direction, i));
    }
  }
  return Smaller(Larger(cosine, Splat(0.0F)), Splat(1.0F));
}

}  // namespace

struct DepthCamera::Layers {
  std::vector<float> jitter_x, jitter_y, axial;  // Unit variance; empty when the effect is off.
  double warm_up = 0.0;                          // Scale error at this moment.
};

// Radial error and field of every pixel; empty if the unit has neither.
std::vector<float> BendOfPixels(const DepthBend& bend, int width, int height) {
  if (bend.field_rms == 0 && bend.radial == 0) return {};
  std::vector<float> relative(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  if (bend.field_rms != 0) relative = SmoothField(bend.field_seed, width, height);
  const double corner_squared =
      (static_cast<double>(width) * width + static_cast<double>(height) * height) / 4.0;
  std::size_t index = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = x - (width - 1) / 2.0;
      const double v = y - (height - 1) / 2.0;
      const double r2 = (u * u + v * v) / corner_squared;
      const double radial = r2 * (1.0 - bend.radial_quartic + bend.radial_quartic * r2);
      float& value = relative[index++];
      value = static_cast<float>(bend.field_rms * value + bend.radial * radial);
    }
  }
  return relative;
}

DepthCamera::DepthCamera(const SensorUnit& unit)
    : unit_(unit),
      rays_(unit.depth_true),
      bend_(BendOfPixels(unit.depth_bend, rays_.width(), rays_.height())) {
  if (unit.speckle > 0) {
    speckle_ = CorrelatedNoise(Hash(unit.seed, 117), rays_.width(), rays_.height(),
                               FilterSigmaOfLag(unit.correlation_px));
  }
  if (unit.depth_bend.change_rms != 0) {
    bend_change_ = SmoothField(unit.depth_bend.change_seed, rays_.width(), rays_.height());
    for (float& value : bend_change_) value *= static_cast<float>(unit.depth_bend.change_rms);
  }
  for (int i = 0; i <= kSlantSteps + 1; ++i)
    slants_.push_back(static_cast<float>(
        NguyenSlant(std::acos(std::min(1.0, static_cast<double>(i) / kSlantSteps)))));
  const Intrinsics& camera = unit_.depth_assumed;
  const Eigen::Matrix3d R_color_depth = unit_.T_color_depth_assumed.linear();
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector2d ideal = Undistort(camera, {x, y});
      assumed_rays_.push_back(
          (R_color_depth * Eigen::Vector3d(ideal.x(), ideal.y(), 1.0)).cast<float>());
    }
  }
}

void DepthCamera::Cast(const World& world, std::span<const MovingPose> rows, int tile_row,
                       const Layers& layers, cv::Mat& true_m, cv::Mat& incidence_cosine,
                       cv::Mat& skin) const {
  const int width = rays_.width();
  const int y_end = std::min(rays_.height(), (tile_row + 1) * kTileSize);
  const int y_mid = std::min(rays_.height() - 1, tile_row * kTileSize + kTileSize / 2);
  const float spread = (0.75F * kTileSize + 6.0F * static_cast<float>(unit_.lateral_noise) + 1.0F) /
                       rays_.focal_px();
  const float margin = 0.002F + 0.6F * static_cast<float>(unit_.depth_readout_s * kTileSize /
                                                          // Speed of a hand, 0.6 m/s.
                                                          rays_.height());
  for (int x_begin = 0; x_begin < width; x_begin += kTileSize) {
    const Ray centre = rows[static_cast<std::size_t>(y_mid)].RayOf(
        rays_.At(std::min(width - 1, x_begin + kTileSize / 2), y_mid, -0.5F, -0.5F), 0.0F);
    const Candidates candidates = world.FindCandidates(centre, spread, margin);
    float sigma_px = 0;
    if (!layers.jitter_x.empty()) {
      const Hit hit = world.Trace(centre, candidates);
      const Vector3f normal = world.Normal(hit.material, centre.origin + hit.t * centre.direction);
      const double angle = std::acos(std::clamp(-normal.dot(centre.direction), 0.0F, 1.0F));
      sigma_px = static_cast<float>(unit_.lateral_noise * NguyenLateralSigma(angle));
    }
    for (int y = tile_row * kTileSize; y < y_end; ++y) {
      for (int x = x_begin; x < std::min(width, x_begin + kTileSize); x += 4) {
        Float4 du = Splat(0.0F);
        Float4 dv = Splat(0.0F);
        if (sigma_px > 0) {
          const std::size_t index = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                    static_cast<std::size_t>(x);
          du = Smaller(Larger(sigma_px * Load(&layers.jitter_x[index]), Splat(-4.0F)), Splat(4.0F));
          dv = Smaller(Larger(sigma_px * Load(&layers.jitter_y[index]), Splat(-4.0F)), Splat(4.0F));
        }
        const Ray4 rays = rows[static_cast<std::size_t>(y)].RayOf(rays_.FourFrom(x, y, du, dv));
        const Hit4 hits = world.Trace(rays, candidates);
        const Int4 met = hits.material != kNothing;
        const Float4 depth = met ? hits.t * rays.inverse_norm : Splat(0.0F);
        std::memcpy(true_m.ptr<float>(y) + x, &depth, sizeof(depth));
        if (!skin.empty())
          for (int i = 0; i < 4; ++i)
            skin.at<std::uint8_t>(y, x + i) = hits.material[i] == kBody ? 1 : 0;
        if (!incidence_cosine.empty()) {
          const Float4 cosine = met ? IncidenceCosine(world, rays, hits) : Splat(1.0F);
          std::memcpy(incidence_cosine.ptr<float>(y) + x, &cosine, sizeof(cosine));
        }
      }
    }
  }
}

inline float DepthCamera::SlantAt(float cosine) const {
  const float place = cosine * kSlantSteps;
  const auto i = static_cast<std::size_t>(place);
  return slants_[i] + (place - static_cast<float>(i)) * (slants_[i + 1] - slants_[i]);
}

inline double DepthCamera::BendAt(std::size_t pixel, double z) const {
  double relative = bend_.empty() ? 0.0 : bend_[pixel];
  if (!bend_change_.empty()) {
    const double d = (z - kBendMiddle_m) / kBendReach_m;
    relative += bend_change_[pixel] * d / (1.0 + std::abs(d));
  }
  return relative;
}

inline double DepthCamera::SpeckleAt(int x, int y, double z) const {
  // Column of the projector from which the beam seen here comes; the pattern repeats.
  const int width = rays_.width();
  double place = std::fmod(x - kProjectorBaseline_m * unit_.depth_true.fx / z, width);
  if (place < 0) place += width;
  const int column = std::min(static_cast<int>(place), width - 1);
  const double fraction = place - column;
  const float* row = &speckle_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width)];
  return (1.0 - fraction) * row[column] + fraction * row[(column + 1) % width];
}

inline double DepthCamera::WithSystematicErrors(int x, int y, double true_z, double warm_up) const {
  const int width = rays_.width();
  const int height = rays_.height();
  const double inverse_corner_squared =
      4.0 / (static_cast<double>(width) * width + static_cast<double>(height) * height);
  const double inverse_corner = std::sqrt(inverse_corner_squared);
  const std::size_t index =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  const double u = x - (width - 1) / 2.0;
  const double v = y - (height - 1) / 2.0;
  return true_z * (1.0 + unit_.depth_scale_error + warm_up + BendAt(index, true_z)) +
         unit_.depth_offset_m +
         true_z * true_z *
             (unit_.depth_bow_per_m * ((u * u + v * v) * inverse_corner_squared - 0.5) +
              (unit_.depth_tilt_per_m[0] * u + unit_.depth_tilt_per_m[1] * v) * inverse_corner);
}

void DepthCamera::MeasureRow(int y, const Layers& layers, const cv::Mat& true_m,
                             const cv::Mat& incidence_cosine, std::uint64_t noise_seed,
                             const ClassDepth* other, cv::Mat& measured_m) const {
  const int width = rays_.width();
  const int height = rays_.height();
  const auto* truth = true_m.ptr<float>(y);
  const auto* above = true_m.ptr<float>(std::max(0, y - 1));
  const auto* below = true_m.ptr<float>(std::min(height - 1, y + 1));
  const float* cosine = incidence_cosine.empty() ? nullptr : incidence_cosine.ptr<float>(y);
  auto* out = measured_m.ptr<float>(y);
  for (int x = 0; x < width; ++x) {
    double z = truth[x];
    out[x] = 0;
    if (!(z > 0)) continue;
    const std::size_t index =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    if (unit_.dropout > 0) {
      const std::uint64_t hash = Hash(noise_seed, index, 5);
      const auto chance = static_cast<float>(UnitUniform(hash));
      const auto lost = static_cast<float>(unit_.dropout) + GrazingLoss(cosine[x]);
      if (chance < lost) continue;
      const float left = truth[std::max(0, x - 1)];
      const float right = truth[std::min(width - 1, x + 1)];
      const float lowest = std::min({left, right, above[x], below[x], truth[x]});
      const float highest = std::max({left, right, above[x], below[x], truth[x]});
      if (highest - lowest > kEdgeStep &&
          highest - lowest > kEdgeStep + 0.02F * lowest * TangentOf(cosine[x])) {
        const auto edge_chance = static_cast<float>(UnitUniform(Hash(hash)));
        if (edge_chance < kEdgeLossFraction) continue;
        if (edge_chance < kEdgeLossFraction + kFlyingFraction)
          z = lowest + UnitUniform(Hash(hash, 1)) * (highest - lowest);
      }
    }
    const double true_z = z;
    if (other != nullptr) {
      // A flying pixel lies between two surfaces whatever the class.
      if (true_z == static_cast<double>(truth[x])) z = other->At(x, y, cosine[x]);
      z += true_z * (layers.warm_up + BendAt(index, true_z));
    } else {
      z = WithSystematicErrors(x, y, true_z, layers.warm_up);
    }
    if (!layers.axial.empty()) {
      const double step = unit_.quantised
                              ? z * z * 2.894e-3
                              : 0.0;  // The PS1080's step: 9000 / z_mm in units of 0.1042 / 4.
      const double sigma = unit_.axial_noise * NguyenAxialSigma(true_z, SlantAt(cosine[x]));
      z += std::sqrt(std::max(0.0, sigma * sigma - step * step / 12.0)) * layers.axial[index];
    }
    if (!speckle_.empty())
      z += unit_.speckle * NguyenAxialSigma(true_z, SlantAt(cosine[x])) * SpeckleAt(x, y, true_z);
    if (!(z > unit_.min_range_m && z < unit_.max_range_m)) continue;
    out[x] =
        static_cast<float>(unit_.quantised ? QuantisePs1080(z / kMillimetre) * kMillimetre : z);
  }
}

void DepthCamera::CastShadow(int y, const cv::Mat& true_m, cv::Mat& measured_m) const {
  // The projector is on the right: a pixel is in shadow if something farther right in the row is
  // hit by a beam farther left, so near edges cast shadows of b f (1/z_f - 1/z_b) pixels to their
  // left.
  const double baseline_px = unit_.projector_baseline_m * unit_.depth_true.fx;
  const auto* truth = true_m.ptr<float>(y);
  auto* out = measured_m.ptr<float>(y);
  double leftmost_beam = std::numeric_limits<double>::infinity();
  for (int x = rays_.width() - 1; x >= 0; --x) {
    if (!(truth[x] > 0)) continue;
    const double beam = x - baseline_px / truth[x];
    if (beam > leftmost_beam + 0.75) out[x] = 0;
    leftmost_beam = std::min(leftmost_beam, beam);
  }
}

cv::Mat DepthCamera::Register(const cv::Mat& measured_m) const {
  const Intrinsics& color = unit_.color_true;
  const Vector3f offset = unit_.T_color_depth_assumed.translation().cast<float>();
  const int footprint =
      static_cast<int>(std::ceil(0.9 * color.fx / unit_.depth_assumed.fx));  // 1 up to 11 % wider
  cv::Mat registered = cv::Mat::zeros(color.height, color.width, CV_16UC1);
  for (int y = 0; y < measured_m.rows; ++y) {
    const auto* in = measured_m.ptr<float>(y);
    for (int x = 0; x < measured_m.cols; ++x) {
      if (!(in[x] > 0)) continue;
      const Vector3f p = in[x] * assumed_rays_[static_cast<std::size_t>(y) *
                                                   static_cast<std::size_t>(measured_m.cols) +
                                               static_cast<std::size_t>(x)] +
                         offset;
      int u = x;
      int v = y;
      if (!unit_.one_camera) {
        const Eigen::Vector2d pixel = Project(color, p.cast<double>());
        if (!(pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < color.width - 0.5 &&
              pixel.y() < color.height - 0.5))
          continue;
        u = static_cast<int>(pixel.x() + 0.5);
        v = static_cast<int>(pixel.y() + 0.5);
      }
      const double units = std::round(p.z() * unit_.depth_units_per_metre);
      if (units < 1 || units > 65535) continue;
      // A wider camera's pixel covers several of the colour image.
      for (int row = v; row < std::min(color.height, v + footprint); ++row) {
        for (int column = u; column < std::min(color.width, u + footprint); ++column) {
          auto& value = registered.at<std::uint16_t>(row, column);
          if (value == 0 || units < value) value = static_cast<std::uint16_t>(units);
        }
      }
    }
  }
  return registered;
}

DepthView DepthCamera::See(const World& world, const Trajectory& trajectory, double time_s,
                           std::uint64_t noise_seed) const {
  const int width = rays_.width();
  const int height = rays_.height();
  std::vector<MovingPose> rows;
  for (int y = 0; y < height; ++y)
    rows.push_back(PoseAt(trajectory, time_s + unit_.depth_readout_s * ((y + 0.5) / height - 0.5),
                          unit_.T_color_depth_true));
  Layers layers;
  if (unit_.lateral_noise > 0) {
    const double sigma_px = kJitterFilterPx * (width / 640.0);
    layers.jitter_x = CorrelatedNoise(Hash(noise_seed, 1), width, height, sigma_px);
    layers.jitter_y = CorrelatedNoise(Hash(noise_seed, 2), width, height, sigma_px);
  }
  DepthView view;
  view.true_m = cv::Mat(height, width, CV_32FC1);
  const bool is_other = unit_.depth_sensor != DepthSensor::kStructuredLight;
  if (is_other) view.skin = cv::Mat(height, width, CV_8UC1);
  if (is_other || unit_.axial_noise > 0 || unit_.speckle > 0 || unit_.dropout > 0)
    view.incidence_cosine = cv::Mat(height, width, CV_32FC1);
  tbb::parallel_for(0, (height + kTileSize - 1) / kTileSize, [&](int row) {
    Cast(world, rows, row, layers, view.true_m, view.incidence_cosine, view.skin);
  });
  return view;
}

DepthShot DepthCamera::Measure(const DepthView& view, double time_s, std::uint64_t noise_seed,
                               double warm_up) const {
  const int width = rays_.width();
  const int height = rays_.height();
  Layers layers;
  layers.warm_up = warm_up;
  if (unit_.axial_noise > 0)
    layers.axial =
        CorrelatedNoise(Hash(noise_seed, 3), width, height, FilterSigmaOfLag(unit_.correlation_px));
  DepthShot shot;
  shot.true_m = view.true_m;
  shot.measured_m = cv::Mat(height, width, CV_32FC1);
  std::optional<ClassDepth> other;
  if (unit_.depth_sensor != DepthSensor::kStructuredLight)
    other.emplace(unit_, view.true_m, view.skin, time_s, noise_seed);
  tbb::parallel_for(0, height, [&](int y) {
    MeasureRow(y, layers, view.true_m, view.incidence_cosine, noise_seed, other ? &*other : nullptr,
               shot.measured_m);
    if (unit_.projector_baseline_m > 0) CastShadow(y, view.true_m, shot.measured_m);
  });
  shot.registered = Register(shot.measured_m);
  return shot;
}

DepthShot DepthCamera::Render(const World& world, const Trajectory& trajectory, double time_s,
                              std::uint64_t noise_seed, double warm_up) const {
  return Measure(See(world, trajectory, time_s, noise_seed), time_s, noise_seed, warm_up);
}

}  // namespace plumb::simulated
