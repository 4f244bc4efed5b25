#include "drivers/simulated/sensor_unit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "algo/types/units.hpp"
#include "drivers/simulated/random.hpp"

namespace plumb::simulated {
namespace {

constexpr double kMaxIncidence = 85.0 * kDegree;  // The model has a pole at 90 degrees.

// Errors of the calibration, uniform within these limits; nominal size.
void DrawOptics(SensorUnit& unit, RandomStream& random, double size) {
  Intrinsics color{640, 480, 525.0 + random.Within(6.0), 0.0, 319.5 + random.Within(5.0), 239.5 + random.Within(5.0), {}};
  color.fy = color.fx * (1.0 + random.Within(0.0015));
  color.distortion = {0.055 + random.Within(0.02), -0.17 + random.Within(0.04), random.Within(0.0012), random.Within(0.0012),
                      0.04 + random.Within(0.03)};
  unit.color_true = color;

  Intrinsics& written = unit.color_written;
  written = color;
  const double focal_error = random.Within(0.0022 * size);
  written.fx *= 1.0 + focal_error + random.Within(0.0005 * size);
  written.fy *= 1.0 + focal_error + random.Within(0.0005 * size);
  written.cx += random.Within(1.2 * size);
  written.cy += random.Within(1.2 * size);
  written.distortion[0] *= 1.0 + random.Within(0.08 * size);
  written.distortion[1] *= 1.0 + random.Within(0.08 * size);
  written.distortion[2] += random.Within(0.0003 * size);
  written.distortion[3] += random.Within(0.0003 * size);

  unit.depth_assumed = {640, 480, 575.8, 575.8, 319.5, 239.5, {}};
  unit.depth_true = unit.depth_assumed;
  unit.depth_true.fx *= 1.0 + random.Within(0.002 * size);
  unit.depth_true.fy = unit.depth_true.fx;
  unit.depth_true.cx += random.Within(1.0 * size);
  unit.depth_true.cy += random.Within(1.0 * size);

  // The infrared camera sits 25 mm beside the colour camera.
  const auto turn = [&](double limit) { return Eigen::Vector3d(random.Within(limit), random.Within(limit), random.Within(limit)); };
  unit.T_color_depth_assumed.linear() = RotationFromVector(turn(0.4 * kDegree));
  unit.T_color_depth_assumed.translation() = Eigen::Vector3d(0.025, 0.0, 0.0) + turn(0.5 * kMillimetre);
  Pose error = Pose::Identity();
  error.linear() = RotationFromVector(turn(0.10 * kDegree * size));
  error.translation() = turn(1.0 * kMillimetre * size);
  unit.T_color_depth_true = unit.T_color_depth_assumed * error;
}

}  // namespace

double NguyenSlant(double incidence) {
  const double theta = std::min(incidence, kMaxIncidence);
  const double rest = std::numbers::pi / 2.0 - theta;
  return theta * theta / (rest * rest);
}

double NguyenLateralSigma(double incidence) {
  const double theta = std::min(incidence, kMaxIncidence);
  return 0.8 + 0.035 * theta / (std::numbers::pi / 2.0 - theta);
}

SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width, int height) {
  if (width < 80 || height < 60 || width > 2560 || height > 1920 || width % 4 != 0)
    throw std::invalid_argument("simulated images must be 80x60 to 2560x1920, the width a multiple of 4");
  SensorUnit unit;
  unit.level = level;
  unit.seed = seed;
  if (level == NoiseLevel::kIdeal) {
    unit.color_true = {640, 480, 525.0, 525.0, 319.5, 239.5, {}};
    unit.color_written = unit.depth_true = unit.depth_assumed = unit.color_true;
  } else {
    RandomStream random(Hash(seed, 81));
    const double size = level == NoiseLevel::kHard ? 1.8 : 1.0;
    DrawOptics(unit, random, size);
    unit.depth_scale_error = random.Within(0.005 * size);
    unit.depth_offset_m = random.Within(1.5 * kMillimetre * size);
    unit.depth_bow_per_m = random.Within(2.5 * kMillimetre * size);
    unit.depth_tilt_per_m = {random.Within(1.0 * kMillimetre * size), random.Within(1.0 * kMillimetre * size)};
    unit.axial_noise = level == NoiseLevel::kHard ? 1.4 : 1.0;
    unit.lateral_noise = 1.0;
    unit.quantised = true;
    unit.projector_baseline_m = 0.075;
    unit.dropout = 0.0006 * size;
    unit.min_range_m = 0.45;
    unit.exposure_s = level == NoiseLevel::kHard ? 0.014 : 0.007;
    unit.readout_s = level == NoiseLevel::kHard ? 0.030 : 0.022;
    unit.depth_delay_s = random.Uniform(0.004, 0.008) * size;
    unit.color_stamp_bias_s = random.Within(0.0015 * size);
    unit.stamp_jitter_s = 0.0003 * size;
    unit.lens_blur_px = level == NoiseLevel::kHard ? 0.75 : 0.5;
    unit.vignetting = 0.25;
    unit.shot_noise = 1.2e-4 * size * size;
    unit.read_noise = 0.0015 * size;
    unit.depth_readout_s = random.Uniform(0.012, 0.028) * (level == NoiseLevel::kHard ? 1.2 : 1.0);
    unit.jpeg_quality = level == NoiseLevel::kHard ? 90 : 95;
  }
  const double pixels = width / 640.0;
  for (Intrinsics* camera : {&unit.color_true, &unit.color_written, &unit.depth_true, &unit.depth_assumed})
    *camera = Resized(*camera, width, height);
  unit.correlation_px *= pixels;
  unit.lateral_noise *= pixels;
  unit.lens_blur_px *= std::max(0.6, pixels);
  return unit;
}

}  // namespace plumb::simulated
