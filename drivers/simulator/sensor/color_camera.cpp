// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/color_camera.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <tbb/parallel_for.h>

#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3f;

constexpr int kInkSide = 6;               // 36 samples in a pixel on an edge of a marker's print,
constexpr int kOutlineSide = 4;           // 16 on the outline of a body or board,
constexpr int kSmoothSide = 2;            // and 4 elsewhere.
constexpr std::uint8_t kInkEdge = 1;      // Two materials of one object meet within reach,
constexpr std::uint8_t kOutlineEdge = 2;  // or two objects.
constexpr float kGain = 0.80F;            // Linear exposure; white boards stay below saturation.
constexpr int kLightLevels = 4096;

// Fraction of the light up to the distance x from the centre of a unit pixel seen through a
// Gaussian blur; integrated once.
class PixelKernel {
 public:
  explicit PixelKernel(double blur_px) {
    const double reach = 0.5 + 4.0 * blur_px;
    for (int i = 0; i <= kSteps; ++i) {
      const double x = -reach + 2.0 * reach * i / kSteps;
      places_.push_back(x);
      const double density = blur_px > 0
                                 ? 0.5 * (std::erf((x + 0.5) / (blur_px * std::numbers::sqrt2)) -
                                          std::erf((x - 0.5) / (blur_px * std::numbers::sqrt2)))
                                 : 1.0;
      fractions_.push_back(i == 0 ? 0.0 : fractions_.back() + density);
    }
    for (double& fraction : fractions_) fraction /= fractions_.back();
  }
  /// Position below which the given fraction of the light falls.
  [[nodiscard]] double Inverse(double fraction) const {
    const auto above = std::upper_bound(fractions_.begin() + 1, fractions_.end() - 1, fraction);
    const auto i = static_cast<std::size_t>(above - fractions_.begin());
    const double step = fractions_[i] - fractions_[i - 1];
    return places_[i - 1] +
           (places_[i] - places_[i - 1]) * (step > 0 ? (fraction - fractions_[i - 1]) / step : 0.5);
  }

 private:
  static constexpr int kSteps = 2000;
  std::vector<double> places_;
  std::vector<double> fractions_;
};

std::vector<int> Permutation(RandomStream& random, int size) {
  std::vector<int> order(static_cast<std::size_t>(size));
  std::iota(order.begin(), order.end(), 0);
  for (int i = size - 1; i > 0; --i)
    std::swap(order[static_cast<std::size_t>(i)],
              order[static_cast<std::size_t>(random.Uniform() * (i + 1))]);
  return order;
}

// Four approximately normal numbers of unit variance at once: sums of the four bytes of a hash.
float NearlyNormal(std::uint64_t hash) {
  const auto sum = static_cast<float>((hash & 0xff) + ((hash >> 8) & 0xff) + ((hash >> 16) & 0xff) +
                                      ((hash >> 24) & 0xff));
  return (sum - 510.0F) * (1.0F / 147.8F);
}

}  // namespace

struct ColorCamera::Shot {
  const World& world;
  std::vector<MovingPose> rows;        // Pose of each row at its mid-exposure.
  std::vector<Candidates> candidates;  // One per tile.
  cv::Mat material;                    // CV_16UC1, at each pixel's centre.
  cv::Mat depth;                       // CV_32FC1, metres along the optical axis.
  cv::Mat edge;                        // CV_8UC1
  int tiles_across;
  Vector3f gain;  // Red, green, blue.
};

ColorCamera::ColorCamera(const SensorUnit& unit)
    : unit_(unit), rays_(unit.color_true, unit.color_lens_rest) {
  BuildSamples();
  for (int i = 0; i < kLightLevels; ++i) {
    const double light = static_cast<double>(static_cast<float>(i) / (kLightLevels - 1));
    const auto code = std::lround(255.0F * static_cast<float>(unit.tone.Encode(light)));
    codes_.push_back(static_cast<std::uint8_t>(code));
  }
}

void ColorCamera::BuildSamples() {
  const PixelKernel kernel(unit_.lens_blur_px);
  RandomStream random(Hash(unit_.seed, 91));
  const auto pattern = [&](int side) {
    // Multi-jittered (Chiu, Shirley, Wang 1994): one sample per cell of the side x side grid, and
    // one in each of the side^2 columns and rows.
    const int count = side * side;
    std::vector<Eigen::Vector3f> samples;  // du, dv, dt
    std::vector<std::vector<int>> columns;
    std::vector<std::vector<int>> rows;
    for (int i = 0; i < side; ++i) {
      columns.push_back(Permutation(random, side));
      rows.push_back(Permutation(random, side));
    }
    const std::vector<int> times = Permutation(random, count);
    for (int j = 0; j < side; ++j) {
      for (int i = 0; i < side; ++i) {
        const auto a = static_cast<std::size_t>(i);
        const auto b = static_cast<std::size_t>(j);
        const double u = (i + (columns[a][b] + 0.5) / side) / side;
        const double v = (j + (rows[b][a] + 0.5) / side) / side;
        const double time = (times[static_cast<std::size_t>(j * side + i)] + 0.5) / count - 0.5;
        samples.emplace_back(static_cast<float>(kernel.Inverse(u)),
                             static_cast<float>(kernel.Inverse(v)),
                             static_cast<float>(unit_.exposure_s * time));
      }
    }
    // The corners of the grid come first: see GatherOutline().
    const auto n = static_cast<std::size_t>(side);
    std::swap(samples[1], samples[n - 1]);
    std::swap(samples[2], samples[n * (n - 1)]);
    std::swap(samples[3], samples[n * n - 1]);
    std::vector<Samples> fours(samples.size() / 4);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      fours[i / 4].du[i % 4] = samples[i].x();
      fours[i / 4].dv[i % 4] = samples[i].y();
      fours[i / 4].dt[i % 4] = samples[i].z();
    }
    return fours;
  };
  for (std::size_t i = 0; i < kNumPatterns; ++i) {
    ink_samples_.push_back(pattern(kInkSide));
    outline_samples_.push_back(pattern(kOutlineSide));
    smooth_samples_.push_back(pattern(kSmoothSide));
  }
}

void ColorCamera::Cast(Shot& shot, int tile_row) const {
  const int y_end = std::min(rays_.height(), (tile_row + 1) * kTileSize);
  const int y_mid = std::min(rays_.height() - 1, tile_row * kTileSize + kTileSize / 2);
  // Half the diagonal of a tile, plus the lens's blur and a margin for the motion during the
  // exposure.
  const float spread = (0.75F * kTileSize + 4.0F * static_cast<float>(unit_.lens_blur_px) + 2.0F) /
                           rays_.focal_px() +
                       0.6F * static_cast<float>(unit_.exposure_s);
  const float margin =
      0.002F +
      0.6F * static_cast<float>(unit_.exposure_s + unit_.readout_s * kTileSize / rays_.height());
  for (int tile = 0; tile < shot.tiles_across; ++tile) {
    const int x_mid = std::min(rays_.width() - 1, tile * kTileSize + kTileSize / 2);
    const Ray centre = shot.rows[static_cast<std::size_t>(y_mid)].RayOf(
        rays_.At(x_mid, y_mid, -0.5F, -0.5F), 0.0F);
    const Candidates candidates = shot.world.FindCandidates(centre, spread, margin);
    shot.candidates[static_cast<std::size_t>(tile_row * shot.tiles_across + tile)] = candidates;
    for (int y = tile_row * kTileSize; y < y_end; ++y) {
      for (int x = tile * kTileSize; x < std::min(rays_.width(), (tile + 1) * kTileSize); x += 4) {
        const Ray4 rays = shot.rows[static_cast<std::size_t>(y)].RayOf(rays_.FourFrom(x, y));
        const Hit4 hits = shot.world.Trace(rays, candidates);
        const Float4 depth = hits.t * rays.inverse_norm;
        for (int i = 0; i < 4; ++i) {
          shot.material.at<std::uint16_t>(y, x + i) = static_cast<Material>(hits.material[i]);
          shot.depth.at<float>(y, x + i) = depth[i];
        }
      }
    }
  }
}

cv::Mat ColorCamera::EdgeMask(const Shot& shot) const {
  // Distance by which an edge is blurred: pixel and lens, and the motion during the exposure.
  const MovingPose& middle = shot.rows[shot.rows.size() / 2];
  const float motion_px = static_cast<float>(unit_.exposure_s) * rays_.focal_px() *
                          (middle.angular_velocity.norm() + middle.velocity.norm() / 0.75F);
  const int reach =
      std::clamp(static_cast<int>(std::ceil(0.5F + 2.0F * static_cast<float>(unit_.lens_blur_px) +
                                            0.5F * motion_px)),
                 1, 8);
  const int width = rays_.width();
  const int height = rays_.height();
  cv::Mat along_row(height, width, CV_8UC1);
  cv::Mat mask(height, width, CV_8UC1);
  tbb::parallel_for(0, height, [&](int y) {
    const auto* material = shot.material.ptr<std::uint16_t>(y);
    auto* out = along_row.ptr<std::uint8_t>(y);
    std::fill(out, out + width, std::uint8_t{0});
    for (int x = 0; x < width; ++x) {
      const Material right = x + 1 < width ? material[x + 1] : material[x];
      const Material below =
          y + 1 < height ? shot.material.at<std::uint16_t>(y + 1, x) : material[x];
      if (material[x] == right && material[x] == below) continue;
      const Material object = ObjectOf(material[x]);
      const std::uint8_t kind =
          object == ObjectOf(right) && object == ObjectOf(below) ? kInkEdge : kOutlineEdge;
      for (int i = std::max(0, x - reach); i < std::min(width, x + reach + 2); ++i) out[i] |= kind;
    }
  });
  tbb::parallel_for(0, height, [&](int y) {
    auto* out = mask.ptr<std::uint8_t>(y);
    std::fill(out, out + width, std::uint8_t{0});
    for (int other = std::max(0, y - reach - 1); other <= std::min(height - 1, y + reach);
         ++other) {
      const auto* in = along_row.ptr<std::uint8_t>(other);
      for (int x = 0; x < width; ++x) out[x] |= in[x];
    }
  });
  return mask;
}

Vector3f ColorCamera::GatherInk(const Shot& shot, int x, int y) const {
  const auto material = shot.material.at<std::uint16_t>(y, x);
  const MovingPose& pose = shot.rows[static_cast<std::size_t>(y)];
  // All in the board's frame, where a sample's position is linear in du, dv and dt before the
  // division.
  const World::BoardPlane& plane = shot.world.PlaneOf(BoardOf(material));
  const Vector3f origin = plane.R_board_world * (pose.p_world - plane.p_world);
  const Vector3f velocity = plane.R_board_world * pose.velocity;
  const Eigen::Matrix3f R_board_camera = plane.R_board_world * pose.R_world_camera;
  const Vector3f direction = R_board_camera * rays_.At(x, y, 0, 0);
  const Vector3f along_u = R_board_camera * rays_.At(x, y, 1, 0) - direction;
  const Vector3f along_v = R_board_camera * rays_.At(x, y, 0, 1) - direction;
  const Vector3f turn =
      plane.R_board_world * pose.angular_velocity.cross(pose.R_world_camera * rays_.At(x, y, 0, 0));
  Int4 black = Splat(0);
  const auto& samples = PatternOf(ink_samples_, x, y);
  for (const Samples& four : samples) {
    const Vector3x4 o = four.dt * velocity + origin;
    const Vector3x4 d = four.du * along_u + four.dv * along_v + four.dt * turn + direction;
    Float4 t = -o.z / d.z;
    if (plane.bulge != 0.0F) t = plane.MeetTop(o, d, t);
    black -= plane.IsBlack(o.x + t * d.x, o.y + t * d.y);
  }
  const Vector3f p = PointAt(shot, x, y);
  const float fraction = static_cast<float>(black[0] + black[1] + black[2] + black[3]) /
                         static_cast<float>(4 * samples.size());
  const Material white = ObjectOf(material);
  const Vector3f paper = shot.world.Albedo({white}, p);
  const Vector3f ink = shot.world.Albedo({static_cast<Material>(white + 1)}, p);
  return shot.world.ShadingAt(material, p).light.cwiseProduct(paper + fraction * (ink - paper));
}

Vector3f ColorCamera::GatherOutline(const Shot& shot, int x, int y,
                                    const Candidates& candidates) const {
  const MovingPose& pose = shot.rows[static_cast<std::size_t>(y)];
  const auto centre = shot.material.at<std::uint16_t>(y, x);
  Vector3f sum = Vector3f::Zero();
  bool mixed = false;
  const auto& samples = PatternOf(outline_samples_, x, y);
  for (const Samples& four : samples) {
    // The first four are at the corners of the pattern: if they see nothing else, nothing else is
    // visible.
    if (&four == &samples[1] && !mixed)
      return centre < kFirstBoard ? Vector3f(sum / 4.0F) : GatherSmooth(shot, x, y);
    const Ray4 rays = pose.RayOf(rays_.At(x, y, four.du, four.dv), four.dt);
    const Hit4 hits = shot.world.Trace(rays, candidates);
    const Vector3x4 places = hits.t * rays.direction + rays.origin;
    for (int i = 0; i < 4; ++i) {
      const auto material = static_cast<Material>(hits.material[i]);
      const Vector3f p = Lane(places, i);
      const Shading shading = shot.world.ShadingAt(material, p);
      sum += shot.world.Albedo(shot.world.PaintOf(material, shading.normal), p)
                 .cwiseProduct(shading.light);
      mixed = mixed || material != centre;
    }
  }
  return sum / static_cast<float>(4 * samples.size());
}

Vector3f ColorCamera::GatherSmooth(const Shot& shot, int x, int y) const {
  const auto material = shot.material.at<std::uint16_t>(y, x);
  const MovingPose& pose = shot.rows[static_cast<std::size_t>(y)];
  const Vector3f p = PointAt(shot, x, y);
  const Shading shading = shot.world.ShadingAt(material, p);
  if (material >= kFirstBoard)
    return shading.light.cwiseProduct(
        shot.world.Albedo(shot.world.PaintOf(material, shading.normal), p));
  // The surface is approximated by its tangent plane over one pixel.
  static_assert(kSmoothSide * kSmoothSide == 4);
  const Samples& four = PatternOf(smooth_samples_, x, y).front();
  const Vector3x4 origin = four.dt * pose.velocity + pose.p_world;
  const Vector3x4 direction = pose.DirectionOf(rays_.At(x, y, four.du, four.dv), four.dt);
  const Float4 t = (shading.normal.dot(p) - Dot(shading.normal, origin)) /
                   Smaller(Dot(shading.normal, direction), Splat(-0.05F));
  return shading.light.cwiseProduct(
      shot.world.MeanAlbedo(shot.world.PaintOf(material, shading.normal), t * direction + origin));
}

Vector3f ColorCamera::PointAt(const Shot& shot, int x, int y) const {
  const MovingPose& pose = shot.rows[static_cast<std::size_t>(y)];
  return pose.p_world + shot.depth.at<float>(y, x) * (pose.R_world_camera * rays_.At(x, y, 0, 0));
}

float ColorCamera::GlareAt(const Shot& shot, int x, int y) const {
  if (shot.world.room().gloss <= 0.0F) return 0.0F;
  const auto material = shot.material.at<std::uint16_t>(y, x);
  if (!IsBoardTop(material)) return 0.0F;
  const MovingPose& pose = shot.rows[static_cast<std::size_t>(y)];
  return shot.world.GlareAt(material, PointAt(shot, x, y), pose.p_world);
}

void ColorCamera::Gather(const Shot& shot, int tile_row, cv::Mat& light_of) const {
  const int width = rays_.width();
  const int height = rays_.height();
  const Intrinsics& camera = unit_.color_true;
  const auto cx = static_cast<float>(camera.cx);
  const auto cy = static_cast<float>(camera.cy);
  const auto vignetting = static_cast<float>(
      4.0 * unit_.vignetting /
      (static_cast<double>(width) * width + static_cast<double>(height) * height));
  const int y_end = std::min(height, (tile_row + 1) * kTileSize);
  // Processed by tiles, so that neighbours find each other's texels in the cache.
  for (int tile = 0; tile < shot.tiles_across; ++tile) {
    const Candidates& candidates =
        shot.candidates[static_cast<std::size_t>(tile_row * shot.tiles_across + tile)];
    for (int y = tile_row * kTileSize; y < y_end; ++y) {
      for (int x = tile * kTileSize; x < std::min(width, (tile + 1) * kTileSize); ++x) {
        const std::uint8_t edge = shot.edge.at<std::uint8_t>(y, x);
        const bool only_ink = edge == kInkEdge && IsBoardTop(shot.material.at<std::uint16_t>(y, x));
        Vector3f light = only_ink    ? GatherInk(shot, x, y)
                         : edge != 0 ? GatherOutline(shot, x, y, candidates)
                                     : GatherSmooth(shot, x, y);
        const float dx = static_cast<float>(x) - cx;
        const float dy = static_cast<float>(y) - cy;
        light += Vector3f::Constant(GlareAt(shot, x, y));
        light *= kGain * (1.0F - vignetting * (dx * dx + dy * dy));
        light = light.cwiseProduct(shot.gain);
        light_of.at<cv::Vec3f>(y, x) = {light.x(), light.y(), light.z()};
      }
    }
  }
}

cv::Mat ColorCamera::Expose(const cv::Mat& light, std::uint64_t noise_seed) const {
  const auto shot_noise = static_cast<float>(unit_.shot_noise);
  const auto read_variance = static_cast<float>(unit_.read_noise * unit_.read_noise);
  const bool noisy = unit_.shot_noise > 0 || unit_.read_noise > 0;
  cv::Mat rgb(light.rows, light.cols, CV_8UC3);
  tbb::parallel_for(0, light.rows, [&](int y) {
    for (int x = 0; x < light.cols; ++x) {
      const auto index = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(light.cols) +
                         static_cast<std::uint64_t>(x);
      const std::uint64_t hash = noisy ? Hash(noise_seed, index) : 0;
      for (int channel = 0; channel < 3; ++channel) {
        float value = light.at<cv::Vec3f>(y, x)[channel];
        if (noisy)
          value += std::sqrt(shot_noise * value + read_variance) *
                   NearlyNormal(channel == 2 ? Hash(hash) : hash >> (32 * channel));
        rgb.at<cv::Vec3b>(y, x)[channel] = codes_[static_cast<std::size_t>(
            std::clamp(value, 0.0F, 1.0F) * (kLightLevels - 1) + 0.5F)];
      }
    }
  });
  return rgb;
}

cv::Mat ColorCamera::Render(const World& world, const Trajectory& trajectory, double time_s,
                            std::uint64_t noise_seed, const Vector3f& gain) const {
  return Expose(Light(world, trajectory, time_s, gain), noise_seed);
}

cv::Mat ColorCamera::Light(const World& world, const Trajectory& trajectory, double time_s,
                           const Vector3f& gain) const {
  const int width = rays_.width();
  const int height = rays_.height();
  const int tile_rows = (height + kTileSize - 1) / kTileSize;
  const int tiles_across = (width + kTileSize - 1) / kTileSize;
  Shot shot{world,
            std::vector<MovingPose>(static_cast<std::size_t>(height)),
            std::vector<Candidates>(static_cast<std::size_t>(tile_rows * tiles_across)),
            cv::Mat(height, width, CV_16UC1),
            cv::Mat(height, width, CV_32FC1),
            cv::Mat(),
            tiles_across,
            gain};
  tbb::parallel_for(0, height, [&](int y) {
    const double row_time = time_s + unit_.readout_s * ((y + 0.5) / height - 0.5);
    shot.rows[static_cast<std::size_t>(y)] = PoseAt(trajectory, row_time, Pose::Identity());
  });
  tbb::parallel_for(0, tile_rows, [&](int row) { Cast(shot, row); });
  shot.edge = EdgeMask(shot);
  cv::Mat light(height, width, CV_32FC3);
  tbb::parallel_for(0, tile_rows, [&](int row) { Gather(shot, row, light); });
  return light;
}

}  // namespace plumb::simulated
