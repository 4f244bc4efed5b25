// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/sensor_unit.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "algo/base/units.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

constexpr double kMaxIncidence = 85.0 * kDegree;  // the model has a pole at 90 degrees

// Errors of the calibration, uniform within these limits; nominal size.
void DrawOptics(SensorUnit& unit, RandomStream& random, double size) {
  Intrinsics color{640,
                   480,
                   525.0 + random.Within(6.0),
                   0.0,
                   319.5 + random.Within(5.0),
                   239.5 + random.Within(5.0),
                   {}};
  color.fy = color.fx * (1.0 + random.Within(0.0015));
  color.distortion = {0.055 + random.Within(0.02), -0.17 + random.Within(0.04),
                      random.Within(0.0012), random.Within(0.0012), 0.04 + random.Within(0.03)};
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

  // The infrared camera is 25 mm beside the colour camera.
  const auto turn = [&](double limit) {
    return Eigen::Vector3d(random.Within(limit), random.Within(limit), random.Within(limit));
  };
  unit.T_color_depth_assumed.linear() = RotationFromVector(turn(0.4 * kDegree));
  unit.T_color_depth_assumed.translation() =
      Eigen::Vector3d(0.025, 0.0, 0.0) + turn(0.5 * kMillimetre);
  Pose error = Pose::Identity();
  error.linear() = RotationFromVector(turn(0.10 * kDegree * size));
  error.translation() = turn(1.0 * kMillimetre * size);
  unit.T_color_depth_true = unit.T_color_depth_assumed * error;
}

void DrawSystematicDepth(SensorUnit& unit, RandomStream& random, double size) {
  unit.depth_scale_error = random.Within(0.005 * size);
  unit.depth_offset_m = random.Within(1.5 * kMillimetre * size);
  unit.depth_bow_per_m = random.Within(2.5 * kMillimetre * size);
  unit.depth_tilt_per_m = {random.Within(1.0 * kMillimetre * size),
                           random.Within(1.0 * kMillimetre * size)};
}

void DrawTimes(SensorUnit& unit, RandomStream& random, NoiseLevel level, double size) {
  const bool hard = level == NoiseLevel::kHard;
  unit.exposure_s = hard ? 0.014 : 0.007;
  unit.readout_s = hard ? 0.030 : 0.022;
  unit.depth_delay_s = random.Uniform(0.004, 0.008) * size;
  unit.color_stamp_bias_s = random.Within(0.0015 * size);
  unit.stamp_jitter_s = 0.0003 * size;
  unit.depth_readout_s = random.Uniform(0.012, 0.028) * (hard ? 1.2 : 1.0);
}

void SetRandomErrors(SensorUnit& unit, NoiseLevel level, double size) {
  const bool hard = level == NoiseLevel::kHard;
  unit.axial_noise = hard ? 1.4 : 1.0;
  unit.lateral_noise = 1.0;
  unit.quantised = true;
  unit.projector_baseline_m = 0.075;
  unit.dropout = 0.0006 * size;
  unit.min_range_m = 0.45;
  unit.lens_blur_px = hard ? 0.75 : 0.5;
  unit.vignetting = 0.25;
  unit.shot_noise = 1.2e-4 * size * size;
  unit.read_noise = 0.0015 * size;
  unit.jpeg_quality = hard ? 90 : 95;
}

// Resets faults that are switched off. All random values were drawn, so that the others do not
// change.
void SwitchOff(SensorUnit& unit) {
  const auto off = [&](Fault fault) { return !unit.faults.Has(fault); };
  if (unit.one_camera) {
    unit.color_true = {640, 480, 525.0, 525.0, 319.5, 239.5, {}};
    unit.color_written = unit.depth_true = unit.depth_assumed = unit.color_true;
    unit.T_color_depth_true = unit.T_color_depth_assumed = Pose::Identity();
  } else if (off(Fault::kCalibration)) {
    unit.color_written = unit.color_true;
    unit.depth_assumed = unit.depth_true;
    unit.T_color_depth_assumed = unit.T_color_depth_true;
  }
  if (off(Fault::kDepthScale)) {
    unit.depth_scale_error = unit.depth_offset_m = unit.depth_bow_per_m = 0.0;
    unit.depth_tilt_per_m = {};
  }
  if (off(Fault::kDepthNoise)) unit.axial_noise = unit.lateral_noise = 0.0;
  if (off(Fault::kQuantisation)) unit.quantised = false;
  if (off(Fault::kShadow)) unit.projector_baseline_m = 0.0;
  if (off(Fault::kDropouts)) unit.dropout = unit.min_range_m = 0.0;
  if (off(Fault::kRollingShutter)) unit.readout_s = unit.depth_readout_s = 0.0;
  if (off(Fault::kMotionBlur)) unit.exposure_s = 0.0;
  if (off(Fault::kDelays)) unit.depth_delay_s = unit.color_stamp_bias_s = unit.stamp_jitter_s = 0.0;
  if (off(Fault::kOptics)) unit.lens_blur_px = unit.vignetting = 0.0;
  if (off(Fault::kImageNoise)) unit.shot_noise = unit.read_noise = 0.0;
  if (off(Fault::kJpeg)) unit.jpeg_quality = 0;
}

void BendDepth(SensorUnit& unit, double size) {
  DepthBend& bend = unit.depth_bend;
  RandomStream random(Hash(unit.seed, 112));
  // At least half of its limit; otherwise some units would hardly have any.
  const double radial = random.Uniform(0.002, 0.004) * (random.Uniform() < 0.5 ? -1.0 : 1.0);
  const double quartic = random.Uniform(0.2, 0.8);
  const double field = random.Uniform(0.0010, 0.0020);
  const double change = field * random.Uniform(0.3, 0.6);
  if (unit.faults.Has(Fault::kDepthRadial)) {
    bend.radial = size * radial;
    bend.radial_quartic = quartic;
  }
  if (unit.faults.Has(Fault::kDepthField)) bend.field_rms = size * field;
  if (unit.faults.Has(Fault::kDepthFieldChange)) bend.change_rms = size * change;
  bend.field_seed = Hash(unit.seed, 113);
  bend.change_seed = Hash(unit.seed, 114);
}

void BendLens(SensorUnit& unit, double size) {
  RandomStream random(Hash(unit.seed, 115));
  const double p1 = random.Within(0.0006 * size);
  const double p2 = random.Within(0.0006 * size);
  LensRest rest;
  for (double& s : rest.prism) s = random.Within(0.0006 * size);
  rest.k4 = random.Within(0.010 * size);
  if (unit.faults.Has(Fault::kLensTangential)) {
    unit.color_true.distortion[2] += p1;
    unit.color_true.distortion[3] += p2;
  }
  if (unit.faults.Has(Fault::kLensHigher)) unit.color_lens_rest = rest;
}

void SetOtherErrors(SensorUnit& unit, NoiseLevel level, double size) {
  const bool hard = level == NoiseLevel::kHard;
  RandomStream random(Hash(unit.seed, 116));
  const double speckle = random.Uniform(0.3, 0.6);
  const double warm_up = random.Within(0.006);
  const double on_before_s = random.Uniform(0.0, hard ? 120.0 : 1200.0);
  const auto on = [&](Fault fault) { return unit.faults.Has(fault); };
  if (on(Fault::kSpeckle)) unit.speckle = size * speckle;
  if (on(Fault::kWarmUp)) unit.warm_up = warm_up;
  unit.on_before_s = on_before_s;
  if (on(Fault::kLostFrames)) unit.lost_frames = 0.04;
  if (on(Fault::kDoubledFrames)) unit.doubled_frames = 0.02;
  unit.steps_exposure = on(Fault::kExposureSteps);
  unit.steps_white_balance = on(Fault::kWhiteBalance);
}

// IEC 61966-2-1, in float precision so that images stay the same bit for bit.
float EncodeSrgb(float light) {
  return light <= 0.0031308F ? 12.92F * light : 1.055F * std::pow(light, 1.0F / 2.4F) - 0.055F;
}

}  // namespace

double ToneCurve::Encode(double light) const {
  if (kind == Kind::kLinear) return light;
  if (kind == Kind::kSrgb) return static_cast<double>(EncodeSrgb(static_cast<float>(light)));
  const double root = std::pow(light, 1.0 / gamma);
  if (kind == Kind::kPower) return root;
  return root + contrast * (root * root * (3.0 - 2.0 * root) - root);
}

ToneCurve DrawToneCurve(std::uint64_t seed) {
  RandomStream random(seed);
  ToneCurve curve;
  curve.kind = static_cast<ToneCurve::Kind>(static_cast<int>(4.0 * random.Uniform()));
  const double gamma = random.Uniform(1.6, 2.8);
  const double contrast = random.Uniform(0.2, 0.6);
  if (curve.kind == ToneCurve::Kind::kPower) curve.gamma = gamma;
  if (curve.kind == ToneCurve::Kind::kSShaped) curve.contrast = contrast;
  return curve;
}

double NguyenSlant(double incidence) {
  const double theta = std::min(incidence, kMaxIncidence);
  const double rest = std::numbers::pi / 2.0 - theta;
  return theta * theta / (rest * rest);
}

double NguyenLateralSigma(double incidence) {
  const double theta = std::min(incidence, kMaxIncidence);
  return 0.8 + 0.035 * theta / (std::numbers::pi / 2.0 - theta);
}

SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width, int height,
                          const FaultSet& faults, DepthSensor sensor) {
  if (width < 80 || height < 60 || width > 2560 || height > 1920 || width % 4 != 0)
    throw std::invalid_argument(
        "simulated images must be 80x60 to 2560x1920, the width a multiple of 4");
  const double size = level == NoiseLevel::kHard ? 1.8 : 1.0;
  SensorUnit unit;
  unit.seed = seed;
  unit.faults = faults;
  unit.one_camera = level == NoiseLevel::kIdeal && !faults.Has(Fault::kCalibration);
  RandomStream random(Hash(seed, 81));
  DrawOptics(unit, random, size);
  DrawSystematicDepth(unit, random, size);
  DrawTimes(unit, random, level, size);
  SetRandomErrors(unit, level, size);
  SwitchOff(unit);
  BendDepth(unit, size);
  BendLens(unit, size);
  SetOtherErrors(unit, level, size);
  if (faults.Has(Fault::kToneCurve)) unit.tone = DrawToneCurve(Hash(seed, 111));

  BecomeClass(unit, sensor, size);

  // Pixels are square: wider images see more to the sides.
  const double pixels = height / 480.0;
  for (Intrinsics* camera :
       {&unit.color_true, &unit.color_written, &unit.depth_true, &unit.depth_assumed}) {
    *camera = Resized(*camera, height * 4 / 3, height);
    camera->cx += 0.5 * (width - camera->width);
    camera->width = width;
  }
  unit.correlation_px *= pixels;
  unit.lateral_noise *= pixels;
  unit.lens_blur_px *= std::max(0.6, pixels);
  return unit;
}

SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width, int height) {
  return MakeSensorUnit(level, seed, width, height, MildFaults(level));
}

}  // namespace plumb::simulated
