// SPDX-License-Identifier: Apache-2.0
#include "tests/support/synthetic_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "algo/base/units.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"

namespace plumb::test {
namespace {

using std::numbers::pi;

double Bump(double x, double y, double x0, double y0, double sx, double sy) {
  const double a = (x - x0) / sx;
  const double b = (y - y0) / sy;
  return std::exp(-0.5 * (a * a + b * b));
}

// Half the cross-section's width and its height along a torso, x in metres from the middle.
struct Section {
  double half_width;
  double height;
};

Section TorsoSection(double x, bool wide) {
  const double end =
      std::sqrt(std::max(0.0, 1 - std::pow(std::abs(x) / 0.3, 6.0)));  // rounded ends
  const double shoulders = wide ? 0.03 * std::exp(-std::pow((x - 0.2) / 0.09, 2))
                                : 0.05 * std::exp(-std::pow((x - 0.17) / 0.08, 2));
  const double waist = wide ? 0.01 * std::exp(-std::pow((x + 0.02) / 0.1, 2))
                            : 0.03 * std::exp(-std::pow((x + 0.05) / 0.1, 2));
  const double width = (wide ? 0.2 : 0.165) + shoulders - waist;
  const double height =
      (wide ? 0.17 : 0.2) + 0.05 * (x / 0.3) - 0.02 * std::exp(-std::pow((x + 0.1) / 0.07, 2));
  return {std::max(width * end, 1e-4), std::max(height * end, 1e-4)};
}

Eigen::Vector3d TorsoPoint(double u, double v, bool wide) {
  const double x = -0.3 * std::cos(pi * u);
  const Section section = TorsoSection(x, wide);
  const double angle = pi * v;
  const double y = section.half_width * std::cos(angle);
  double z = section.height * std::pow(std::max(std::sin(angle), 0.0), 0.8);
  const double on_top = std::sin(angle) * std::min(1.0, section.height / 0.1);
  z += on_top *
       (0.025 * Bump(x, y, 0.1, 0.08, 0.05, 0.05) + 0.018 * Bump(x, y, 0.1, -0.07, 0.05, 0.045) -
        0.012 * Bump(x, y, -0.12, 0.03, 0.05, 0.06));
  if (wide) z += on_top * 0.03 * Bump(x, y, -0.1, -0.02, 0.09, 0.1);
  return {x, y, z};
}

struct Limb {
  Eigen::Vector2d from, to;
  double radius_from, radius_to, height;
};

// Height of a full body over its support at x, y: capsules joined smoothly.
double FullBodyHeight(double x, double y) {
  static const std::array<Limb, 6> limbs = {{
      {{0.72, 0.0}, {0.82, 0.01}, 0.075, 0.08, 0.2},     // head
      {{-0.05, 0.02}, {0.5, -0.01}, 0.17, 0.19, 0.21},   // trunk
      {{-0.85, 0.13}, {-0.05, 0.09}, 0.05, 0.09, 0.15},  // legs
      {{-0.83, -0.16}, {-0.05, -0.08}, 0.05, 0.09, 0.145},
      {{-0.05, 0.33}, {0.48, 0.22}, 0.035, 0.055, 0.1},  // arms
      {{-0.03, -0.35}, {0.48, -0.22}, 0.035, 0.055, 0.105},
  }};
  double sum = 0.0;
  for (const Limb& limb : limbs) {
    const Eigen::Vector2d along = limb.to - limb.from;
    const double t =
        std::clamp((Eigen::Vector2d(x, y) - limb.from).dot(along) / along.squaredNorm(), 0.0, 1.0);
    const double r = ((Eigen::Vector2d(x, y) - limb.from) - t * along).norm() /
                     (limb.radius_from + t * (limb.radius_to - limb.radius_from));
    const double profile = r < 1 ? std::sqrt(1 - r * r) : 0.0;
    sum += std::pow(limb.height * (0.75 + 0.25 * t) * profile, 4.0);
  }
  return std::pow(sum, 0.25);
}

Eigen::Vector3d BodyPoint(BodyShape shape, double u, double v) {
  switch (shape) {
    case BodyShape::kTorso:
      return TorsoPoint(u, v, false);
    case BodyShape::kTorsoWide:
      return TorsoPoint(u, v, true);
    case BodyShape::kFullBody: {
      const double x = -0.92 + 1.84 * u;
      const double y = 0.42 * (1 - 2 * v);
      return {x, y, FullBodyHeight(x, y)};
    }
    case BodyShape::kCylinder: {
      const double angle = pi * v;
      return {-0.3 + 0.6 * u, 0.12 * std::cos(angle), 0.12 * std::sin(angle)};
    }
  }
  return Eigen::Vector3d::Zero();
}

// Sum of random waves: smooth noise of the given standard deviation with features of some
// centimetres.
class SmoothNoise {
 public:
  SmoothNoise(unsigned seed, double sigma_m) : sigma_m_(sigma_m) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(0, 2 * pi);
    for (Wave& wave : waves_) {
      wave.k = Eigen::Vector3d(normal(random), normal(random), normal(random)) * (2 * pi / 0.05);
      wave.phase = uniform(random);
    }
  }
  double operator()(const Eigen::Vector3d& p) const {
    if (sigma_m_ == 0) return 0.0;
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += std::sin(wave.k.dot(p) + wave.phase);
    return sigma_m_ * sum / std::sqrt(waves_.size() / 2.0);
  }

 private:
  struct Wave {
    Eigen::Vector3d k;
    double phase;
  };
  double sigma_m_;
  std::array<Wave, 24> waves_;
};

// Means of the points and normals in cubes of 3 mm, as the reconstruction merges its cloud.
class VoxelCloud {
 public:
  void Add(const Eigen::Vector3d& p, const Eigen::Vector3d& n) {
    const Eigen::Array3i key = ((p.array() + 10.0) / 0.003).floor().cast<int>();
    samples_.push_back(
        {(std::int64_t{key[2]} << 40) | (std::int64_t{key[1]} << 20) | key[0], p, n});
  }
  [[nodiscard]] PointCloud Take(const Pose& T_scene_reference) {
    std::vector<std::pair<std::int64_t, std::size_t>> order;
    for (std::size_t i = 0; i < samples_.size(); ++i) order.emplace_back(samples_[i].voxel, i);
    std::sort(order.begin(), order.end());
    PointCloud cloud;
    for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
      Eigen::Vector3d p = Eigen::Vector3d::Zero();
      Eigen::Vector3d n = Eigen::Vector3d::Zero();
      for (end = begin; end < order.size() && order[end].first == order[begin].first; ++end) {
        p += samples_[order[end].second].p;
        n += samples_[order[end].second].n;
      }
      cloud.points.push_back(
          (T_scene_reference * (p / static_cast<double>(end - begin))).cast<float>());
      cloud.normals.push_back((T_scene_reference.linear() * n.normalized()).cast<float>());
    }
    return cloud;
  }

 private:
  struct Sample {
    std::int64_t voxel;
    Eigen::Vector3d p;
    Eigen::Vector3d n;
  };
  std::vector<Sample> samples_;
};

// Collects samples of one scan as a cloud and as a height map of the highest sample a cell.
class Scanner {
 public:
  Scanner(const SyntheticOptions& options, const GridShape& grid)
      : options_(options),
        map_(grid),
        noise_(options.seed * 7 + 1, options.noise_m),
        random_(options.seed) {}

  void See(const Eigen::Vector3d& p, const Eigen::Vector3d& normal) {
    if (normal.z() < options_.min_up || (options_.hidden && options_.hidden(p))) return;
    const Eigen::Vector3d seen = p + noise_(p) * normal;
    cloud_.Add(seen, Tilted(normal));
    const auto cell = map_.grid.cell(seen.x(), seen.y());
    if (cell && !(map_.z[*cell] >= seen.z())) map_.z[*cell] = static_cast<float>(seen.z());
  }

  // Level ground over the rectangle, where no body is above: a cloud point every second cell, with
  // the four cells around it.
  void SeeLevel(const std::vector<std::uint8_t>& shadow, double y_low, double y_high, double z) {
    const GridShape& grid = map_.grid;
    for (int row = 0; row + 1 < grid.height; row += 2) {
      if (grid.y_centre(row) < y_low || grid.y_centre(row) > y_high) continue;
      for (int column = 0; column + 1 < grid.width; column += 2) {
        const Eigen::Vector3d p(grid.x_centre(column) + 0.5 * grid.step,
                                grid.y_centre(row) + 0.5 * grid.step, z);
        if (options_.hidden && options_.hidden(p)) continue;
        const float height = static_cast<float>(z + noise_(p));
        bool seen = false;
        for (int k = 0; k < 4; ++k) {
          const std::size_t cell =
              static_cast<std::size_t>(row + k / 2) * static_cast<std::size_t>(grid.width) +
              static_cast<std::size_t>(column + k % 2);
          if (shadow[cell] != 0) continue;
          if (!(map_.z[cell] >= height)) map_.z[cell] = height;
          seen = true;
        }
        if (seen) cloud_.Add({p.x(), p.y(), height}, Tilted(Eigen::Vector3d::UnitZ()));
      }
    }
  }

  [[nodiscard]] double Jitter() {
    return std::uniform_real_distribution<double>(-0.5, 0.5)(random_);
  }
  [[nodiscard]] const HeightMap& map() const { return map_; }
  [[nodiscard]] VoxelCloud& cloud() { return cloud_; }

 private:
  [[nodiscard]] Eigen::Vector3d Tilted(const Eigen::Vector3d& normal) {
    if (options_.normal_noise_rad == 0) return normal;
    std::normal_distribution<double> tilt(0, options_.normal_noise_rad);
    return (normal + Eigen::Vector3d(tilt(random_), tilt(random_), tilt(random_))).normalized();
  }

  const SyntheticOptions& options_;
  HeightMap map_;
  SmoothNoise noise_;
  std::mt19937 random_;
  VoxelCloud cloud_;
};

// A body sampled on a fine grid of its parameters, normals from the neighbours; made once a shape.
class SampleTable {
 public:
  explicit SampleTable(BodyShape shape) {
    std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(kRows) * kColumns);
    for (int i = 0; i < kRows; ++i) {
      for (int j = 0; j < kColumns; ++j)
        points[At(i, j)] = BodyPoint(shape, (i + 0.5) / kRows, (j + 0.5) / kColumns);
    }
    samples_.resize(points.size());
    for (int i = 1; i + 1 < kRows; ++i) {
      for (int j = 1; j + 1 < kColumns; ++j) {
        const Eigen::Vector3d n = (points[At(i + 1, j)] - points[At(i - 1, j)])
                                      .cross(points[At(i, j + 1)] - points[At(i, j - 1)])
                                      .normalized();
        samples_[At(i, j)] = {points[At(i, j)], n.z() < 0 ? Eigen::Vector3d(-n) : n};
      }
    }
  }
  static constexpr int kRows = 1000;
  static constexpr int kColumns = 900;
  [[nodiscard]] const BodySample& at(int i, int j) const { return samples_[At(i, j)]; }

  static const SampleTable& Of(BodyShape shape) {
    static const SampleTable torso(BodyShape::kTorso);
    static const SampleTable wide(BodyShape::kTorsoWide);
    static const SampleTable cylinder(BodyShape::kCylinder);
    return shape == BodyShape::kTorso ? torso : shape == BodyShape::kTorsoWide ? wide : cylinder;
  }

 private:
  static std::size_t At(int i, int j) {
    return static_cast<std::size_t>(i) * kColumns + static_cast<std::size_t>(j);
  }
  std::vector<BodySample> samples_;
};

// Random samples, about one a square millimetre and a half, different in every scan.
std::vector<BodySample> BodySamples(BodyShape shape, Scanner& scanner) {
  std::vector<BodySample> samples;
  if (shape != BodyShape::kFullBody) {
    const SampleTable& table = SampleTable::Of(shape);
    for (int i = 2; i + 2 < SampleTable::kRows; i += 2) {
      for (int j = 2; j + 2 < SampleTable::kColumns; j += 2) {
        samples.push_back(
            table.at(i + (scanner.Jitter() > 0 ? 1 : 0), j + (scanner.Jitter() > 0 ? 1 : 0)));
      }
    }
    return samples;
  }
  constexpr int kRows = 1500;
  constexpr int kColumns = 700;
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < kColumns; ++j) {
      const double u = (i + 0.5 + 0.8 * scanner.Jitter()) / kRows;
      const double v = (j + 0.5 + 0.8 * scanner.Jitter()) / kColumns;
      if (BodyPoint(shape, u, v).z() > 0.005) samples.push_back(SampleBody(shape, u, v));
    }
  }
  return samples;
}

void SeeBody(const SyntheticOptions& options, Scanner& scanner, std::vector<std::uint8_t>& shadow) {
  for (const BodySample& sample : BodySamples(options.shape, scanner)) {
    const Eigen::Vector3d p_body =
        options.deform ? Eigen::Vector3d(sample.p + options.deform(sample.p)) : sample.p;
    const Eigen::Vector3d p = options.T_reference_body * p_body;
    if (p.z() < 0) continue;
    const auto cell = scanner.map().grid.cell(p.x(), p.y());
    if (cell) shadow[*cell] = 1;
    scanner.See(p, options.T_reference_body.linear() * sample.normal);
  }
}

MarkerMap MakeMarkers(const SyntheticOptions& options, const GridShape& grid) {
  MarkerMap markers;
  std::mt19937 random(options.seed + 100);
  std::normal_distribution<double> noise(0, 1);
  const double x_high = grid.x_min + grid.width * grid.step - 0.15;
  const double y_high = grid.y_min + grid.height * grid.step - 0.15;
  const double x_mid = 0.5 * (grid.x_min + x_high);
  const std::array<Eigen::Vector2d, 8> places = {{{0, 0},
                                                  {x_mid, 0.03},
                                                  {x_high, -0.02},
                                                  {x_high, 0.5 * y_high},
                                                  {x_high, y_high},
                                                  {x_mid, y_high},
                                                  {-0.02, y_high},
                                                  {0.03, 0.5 * y_high}}};
  for (std::size_t k = 0; k < places.size(); ++k) {
    Pose T_reference_marker = Pose::Identity();
    T_reference_marker.linear() =
        Eigen::AngleAxisd(k == 0 ? 0.0 : 0.7 * static_cast<double>(k), Eigen::Vector3d::UnitZ())
            .toRotationMatrix();
    T_reference_marker.translation() = Eigen::Vector3d(places[k].x(), places[k].y(), 0);
    SceneMarker marker;
    marker.num_views = 10;
    marker.sigma_m = std::max(options.marker_noise_m, 0.0003);
    marker.corners = CornersInMarkerFrame(0.104);
    for (Eigen::Vector3d& p : marker.corners) {
      p = T_reference_marker * p +
          options.marker_noise_m * Eigen::Vector3d(noise(random), noise(random), noise(random));
      p = options.T_scene_reference * p;
    }
    if (!options.hidden_markers.contains(static_cast<int>(k)))
      markers[static_cast<int>(k)] = marker;
  }
  return markers;
}

GridShape GridFor(BodyShape shape) {
  GridShape grid;
  grid.x_min = grid.y_min = -0.15;
  grid.width = shape == BodyShape::kFullBody ? 1600 : 1000;
  grid.height = 800;
  return grid;
}

}  // namespace

BodySample SampleBody(BodyShape shape, double u, double v) {
  constexpr double kStep = 1e-6;
  const Eigen::Vector3d du = BodyPoint(shape, u + kStep, v) - BodyPoint(shape, u - kStep, v);
  const Eigen::Vector3d dv = BodyPoint(shape, u, v + kStep) - BodyPoint(shape, u, v - kStep);
  Eigen::Vector3d normal = du.cross(dv).normalized();
  if (normal.z() < 0) normal = -normal;
  return {BodyPoint(shape, u, v), normal};
}

Eigen::Vector3d BodyCentroid(BodyShape shape) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double total = 0.0;
  for (int i = 1; i < 100; ++i) {
    for (int j = 1; j < 100; ++j) {
      const double h = 0.004;
      const Eigen::Vector3d du =
          BodyPoint(shape, i / 100.0 + h, j / 100.0) - BodyPoint(shape, i / 100.0 - h, j / 100.0);
      const Eigen::Vector3d dv =
          BodyPoint(shape, i / 100.0, j / 100.0 + h) - BodyPoint(shape, i / 100.0, j / 100.0 - h);
      const Eigen::Vector3d p = BodyPoint(shape, i / 100.0, j / 100.0);
      const double area = p.z() > 0.03 ? du.cross(dv).norm() : 0.0;
      sum += area * p;
      total += area;
    }
  }
  return sum / total;
}

Scene MakeSyntheticScene(const SyntheticOptions& options) {
  const GridShape grid = GridFor(options.shape);
  Scanner scanner(options, grid);
  std::vector<std::uint8_t> shadow(grid.num_cells(), 0);
  SeeBody(options, scanner, shadow);
  if (options.couch) {
    scanner.SeeLevel(shadow, 0.15, 0.75, 0.0);
    scanner.SeeLevel(shadow, grid.y_min, 0.15, -0.7);
    scanner.SeeLevel(shadow, 0.75, 2.0, -0.7);
  } else {
    scanner.SeeLevel(shadow, grid.y_min, 2.0, 0.0);
  }

  Scene scene;
  const bool own_frame = options.T_scene_reference.matrix() != Pose::Identity().matrix();
  scene.frame = own_frame ? SceneFrame::kFirstKeyframe : SceneFrame::kReferenceMarker;
  scene.room_markers.dictionary = "DICT_6X6_250";
  scene.room_markers.length_m = 0.104;
  scene.room_markers.reference = 0;
  scene.markers = MakeMarkers(options, grid);
  if (options.with_cloud) scene.cloud = scanner.cloud().Take(options.T_scene_reference);
  if (!own_frame) scene.height_map = scanner.map();
  return scene;
}

SensorSensitivity KnownCalibration(const Scene& scene) {
  constexpr std::size_t kPointsPerPatch = 200;
  SensorSensitivity known;
  known.stated = {640, 480, 525, 525, 319.5, 239.5, {}};
  known.estimate = CalibrationVector::Zero();
  known.covariance = CalibrationMatrix::Zero();
  const SensorSensitivity::Derivative still =
      SensorSensitivity::Derivative::Zero(3, kCalibrationSize);
  for (std::size_t i = 0; i < scene.cloud.size(); i += kPointsPerPatch)
    known.surface.push_back({scene.cloud.points[i], kPointsPerPatch, still});
  for (const auto& [id, marker] : scene.markers) known.markers[id] = still;
  return known;
}

Pose BodyMotionAbout(const Eigen::Vector3d& centre, const Eigen::Vector3d& shift_m, double yaw_deg,
                     double pitch_deg, double roll_deg) {
  const Pose R(Eigen::AngleAxisd(yaw_deg * kDegree, Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(pitch_deg * kDegree, Eigen::Vector3d::UnitX()) *
               Eigen::AngleAxisd(roll_deg * kDegree, Eigen::Vector3d::UnitY()));
  return Eigen::Translation3d(centre + shift_m) * R * Eigen::Translation3d(-centre);
}

}  // namespace plumb::test
