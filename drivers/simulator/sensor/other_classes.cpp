// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/other_classes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "algo/base/units.hpp"
#include "drivers/simulator/sensor/noise_field.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

constexpr double kTwoPiHere = 2.0 * std::numbers::pi;
constexpr double kStep_m = 0.02;    // Of two surfaces, where a window matches the nearer one.
constexpr double kWiggle_m = 0.5;   // Period of a time-of-flight camera's cyclic error.
constexpr double kMultipath = 0.3;  // Share of a hollow's depth that its walls add.
constexpr double kMostMultipath_m = 0.015;
constexpr int kHollowReach_px = 25;  // At 640 columns.

// A value that wanders smoothly with time, variance 1.
double Wander(std::uint64_t seed, double time_s) {
  RandomStream random(seed);
  double sum = 0.0;
  for (const double rate_hz : {0.3, 0.7, 1.7})
    sum += std::sin(kTwoPiHere * (rate_hz * time_s + random.Uniform()));
  return sum * std::sqrt(2.0 / 3.0);
}

void DropStructuredLight(SensorUnit& unit) {
  unit.depth_scale_error = unit.depth_offset_m = unit.depth_bow_per_m = 0.0;
  unit.depth_tilt_per_m = {};
  unit.depth_bend.field_rms *= 0.3;
  unit.depth_bend.change_rms *= 0.3;
  unit.depth_bend.radial *= 0.3;
  unit.axial_noise = unit.lateral_noise = unit.speckle = 0.0;
  unit.quantised = false;
  unit.depth_readout_s = 0.0;
  unit.depth_units_per_metre = 1000.0;
}

// Another focal length and baseline between the two cameras, with errors of the same size.
void Reposition(SensorUnit& unit, double focal_px, const Eigen::Vector3d& at_m) {
  if (unit.one_camera) return;
  const double wrong = unit.depth_true.fx / unit.depth_assumed.fx;
  const Pose error = unit.T_color_depth_assumed.inverse() * unit.T_color_depth_true;
  unit.depth_assumed.fx = unit.depth_assumed.fy = focal_px;
  unit.depth_true.fx = unit.depth_true.fy = wrong * focal_px;
  unit.T_color_depth_assumed.translation() = at_m;
  unit.T_color_depth_true = unit.T_color_depth_assumed * error;
}

void BecomeStereo(SensorUnit& unit, RandomStream& random, double size) {
  ClassErrors& e = unit.class_errors;
  Reposition(unit, 0.63 * unit.color_written.fx, {0.0148, 0.0, 0.0});
  e.baseline_m = 0.0502;
  e.correlation_px = 16.0;
  if (unit.projector_baseline_m > 0) unit.projector_baseline_m = e.baseline_m;
  unit.min_range_m = std::min(unit.min_range_m, 0.2);
  const double disparity_px = size * random.Uniform(0.15, 0.4);
  const double sign = random.Uniform() < 0.5 ? -1.0 : 1.0;
  const double tilt_px = size * random.Within(0.1);
  const double k1 = random.Uniform(0.03, 0.09);
  const double k2 = random.Uniform(-0.2, -0.08);
  const double delay_s = random.Uniform(0.0, 0.012);
  if (unit.faults.Has(Fault::kDepthScale)) {
    e.disparity_px = sign * disparity_px;
    e.disparity_tilt_px = tilt_px;
    e.ripple_px = 0.05;
  }
  if (unit.faults.Has(Fault::kDepthNoise)) {
    e.noise_px = 0.05 * size;
    e.fatten_px = 5;
  }
  if (unit.faults.Has(Fault::kDelays)) unit.depth_delay_s = delay_s;
  // The maker states no distortion, because it measured none.
  if (unit.one_camera || !unit.faults.Has(Fault::kCalibration)) return;
  unit.color_true.distortion[0] = k1;
  unit.color_true.distortion[1] = k2;
  unit.color_true.distortion[4] = 0.0;
  unit.color_written.distortion = {};
}

void BecomeTimeOfFlight(SensorUnit& unit, RandomStream& random, double size) {
  ClassErrors& e = unit.class_errors;
  Reposition(unit, 0.96 * unit.color_written.fx, {0.032, 0.002, -0.002});
  e.correlation_px = 2.0;
  unit.projector_baseline_m = 0.0;
  unit.min_range_m = std::min(unit.min_range_m, 0.25);
  const double offset_m = size * random.Within(0.006);
  const double phase = random.Uniform();
  const double skin_m = 0.010 + random.Within(0.003);
  if (unit.faults.Has(Fault::kDepthScale)) {
    e.offset_m = offset_m;
    e.wiggle_m = size * 0.003;
    e.wiggle_phase = phase;
    e.multipath = kMultipath;
    e.skin_m = skin_m;
  }
  if (unit.faults.Has(Fault::kDepthNoise)) e.noise_m = size * 0.001;
}

// Interpolated along the colour image's edges, so that it lies on its grid.
void BecomeLidar(SensorUnit& unit, RandomStream& random, double size) {
  ClassErrors& e = unit.class_errors;
  unit.depth_true = unit.color_true;
  unit.depth_assumed = unit.color_written;
  unit.T_color_depth_true = unit.T_color_depth_assumed = Pose::Identity();
  unit.projector_baseline_m = unit.dropout = unit.min_range_m = 0.0;
  e.correlation_px = 60.0;
  const double offset_m = size * random.Within(0.006);
  if (unit.faults.Has(Fault::kDepthScale)) {
    e.offset_m = offset_m;
    e.wander_m = size * 0.005;
    e.wander_rad = size * 0.5 * kDegree;
  }
  if (unit.faults.Has(Fault::kDepthNoise)) e.noise_m = size * 0.003;
}

}  // namespace

void BecomeClass(SensorUnit& unit, DepthSensor sensor, double size) {
  if (sensor == DepthSensor::kStructuredLight) return;
  unit.depth_sensor = sensor;
  DropStructuredLight(unit);
  RandomStream random(Hash(unit.seed, 121));
  if (sensor == DepthSensor::kActiveStereo)
    BecomeStereo(unit, random, size);
  else if (sensor == DepthSensor::kTimeOfFlight)
    BecomeTimeOfFlight(unit, random, size);
  else
    BecomeLidar(unit, random, size);
}

ClassDepth::ClassDepth(const SensorUnit& unit, const cv::Mat& true_m, const cv::Mat& skin,
                       double time_s, std::uint64_t noise_seed)
    : unit_(unit), true_m_(true_m), skin_(skin), pixels_(true_m.cols / 640.0) {
  const ClassErrors& e = unit.class_errors;
  if (e.noise_px > 0 || e.noise_m > 0)
    noise_ = CorrelatedNoise(Hash(noise_seed, 3), true_m.cols, true_m.rows,
                             FilterSigmaOfLag(pixels_ * e.correlation_px));
  const auto wander = [&](std::uint64_t of) { return Wander(Hash(unit.seed, 122, of), time_s); };
  offset_m_ = e.offset_m + e.wander_m * wander(0);
  tilt_x_ = e.wander_rad * wander(1);
  tilt_y_ = e.wander_rad * wander(2);
}

double ClassDepth::Beside(int x, int y, int dx, int dy) const {
  const auto reach = [&](int d) { return static_cast<int>(std::lround(d * pixels_)); };
  const float z = true_m_.at<float>(std::clamp(y + reach(dy), 0, true_m_.rows - 1),
                                    std::clamp(x + reach(dx), 0, true_m_.cols - 1));
  return z > 0 ? z : true_m_.at<float>(y, x);
}

double ClassDepth::At(int x, int y, float cosine) const {
  switch (unit_.depth_sensor) {
    case DepthSensor::kActiveStereo:
      return Stereo(x, y);
    case DepthSensor::kTimeOfFlight:
      return TimeOfFlight(x, y, cosine);
    default:
      return Lidar(x, y);
  }
}

double ClassDepth::Stereo(int x, int y) const {
  const ClassErrors& e = unit_.class_errors;
  double z = true_m_.at<float>(y, x);
  // A window that holds part of a nearer surface finds that one.
  if (e.fatten_px > 0) {
    const int r = e.fatten_px, h = (e.fatten_px + 1) / 2;
    for (const auto& [dx, dy] : std::array<std::array<int, 2>, 8>{
             {{r, 0}, {-r, 0}, {0, r}, {0, -r}, {h, h}, {-h, h}, {h, -h}, {-h, -h}}})
      if (const double beside = Beside(x, y, dx, dy); beside < z - kStep_m) z = beside;
  }
  const double base = unit_.depth_true.fx * e.baseline_m;
  double disparity = base / z;
  const double half = true_m_.cols / 2.0;
  const auto index = static_cast<std::size_t>(y) * static_cast<std::size_t>(true_m_.cols) +
                     static_cast<std::size_t>(x);
  disparity += pixels_ * (e.disparity_px + e.disparity_tilt_px * (x - half) / half) +
               e.ripple_px * std::sin(kTwoPiHere * disparity);
  if (!noise_.empty()) disparity += pixels_ * e.noise_px * noise_[index];
  return base / std::max(disparity, 1.0);
}

double ClassDepth::TimeOfFlight(int x, int y, float cosine) const {
  const ClassErrors& e = unit_.class_errors;
  const double z = true_m_.at<float>(y, x);
  double measured = z + offset_m_;
  measured += e.wiggle_m * std::sin(kTwoPiHere * (z / kWiggle_m + e.wiggle_phase));
  if (e.multipath > 0) {
    const int r = kHollowReach_px;
    double walls = 0.0;
    for (const auto& [dx, dy] :
         std::array<std::array<int, 2>, 4>{{{r, 0}, {-r, 0}, {0, r}, {0, -r}}})
      walls += 0.25 * std::clamp(Beside(x, y, dx, dy), z - 0.1, z + 0.1);
    measured += std::clamp(e.multipath * (z - walls), 0.0, kMostMultipath_m);
  }
  if (!skin_.empty() && skin_.at<std::uint8_t>(y, x) != 0) measured += e.skin_m;
  if (noise_.empty()) return measured;
  const auto index = static_cast<std::size_t>(y) * static_cast<std::size_t>(true_m_.cols) +
                     static_cast<std::size_t>(x);
  // Less light comes back from afar and from a slope.
  return measured + e.noise_m * (1.0 + z * z) / std::max(0.2F, cosine) * noise_[index];
}

double ClassDepth::Lidar(int x, int y) const {
  const ClassErrors& e = unit_.class_errors;
  const double z = true_m_.at<float>(y, x);
  const auto index = static_cast<std::size_t>(y) * static_cast<std::size_t>(true_m_.cols) +
                     static_cast<std::size_t>(x);
  const double across = z * (x - true_m_.cols / 2.0) / unit_.depth_true.fx;
  const double down = z * (y - true_m_.rows / 2.0) / unit_.depth_true.fy;
  const double noise_m = noise_.empty() ? 0.0 : e.noise_m * static_cast<double>(noise_[index]);
  return z + offset_m_ + tilt_x_ * across + tilt_y_ * down + noise_m;
}

}  // namespace plumb::simulated
