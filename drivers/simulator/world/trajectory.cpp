// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/trajectory.hpp"

#include <algorithm>
#include <cmath>

#include "algo/base/units.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

// From 0 to 1 over [0, 1]: constant speed with soft ends (an eighth of the time each).
double SoftRamp(double s) {
  constexpr double kEase = 0.125;
  const auto eased = [](double u) {
    return u - std::sin(kTwoPi / 2.0 * u / kEase) * kEase / (kTwoPi / 2.0);
  };  // integral of 1 - cos
  s = std::clamp(s, 0.0, 1.0);
  const double whole = 1.0 - kEase;
  if (s < kEase) return 0.5 * eased(s) / whole;
  if (s > 1.0 - kEase) return 1.0 - 0.5 * eased(1.0 - s) / whole;
  return (s - 0.5 * kEase) / whole;
}

}  // namespace

double Trajectory::Wave::At(double time_s) const {
  return amplitude * std::sin(kTwoPi * frequency_hz * time_s + phase);
}

double Trajectory::Sum(const Waves& waves, double time_s) {
  double sum = 0;
  for (const Wave& wave : waves) sum += wave.At(time_s);
  return sum;
}

Trajectory::Trajectory(const SweepOptions& options) : options_(options) {
  RandomStream random(Hash(options.seed, 71));
  swing_phase_ = random.Uniform(0.0, kTwoPi);
  // Two slow drifts of the arm, then tremor at 2 to 9 Hz with an amplitude that decreases with
  // frequency.
  constexpr std::array<double, 5> kLowest = {0.12, 0.45, 1.8, 3.5, 6.5};
  constexpr std::array<double, 5> kHighest = {0.25, 0.90, 3.0, 5.5, 9.0};
  constexpr std::array<double, 5> kPosition = {0.020, 0.006, 0.0012, 0.0005, 0.0002};
  constexpr std::array<double, 5> kRotation = {2.5 * kDegree, 1.0 * kDegree, 0.18 * kDegree,
                                               0.09 * kDegree, 0.04 * kDegree};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < 5; ++i) {
      const double factor = i < 2 ? 1.0 : options.tremor;
      const auto draw = [&](double amplitude) {
        const double size = factor * amplitude * random.Uniform(0.6, 1.2);
        const double frequency = random.Uniform(kLowest[i], kHighest[i]);
        return Wave{size, frequency, random.Uniform(0.0, kTwoPi)};
      };
      position_[axis].push_back(draw(kPosition[i]));
      rotation_[axis].push_back(draw(kRotation[i]));
    }
  }
  if (options.tremble_m > 0 || options.tremble_rad > 0) AddTremble();
}

void Trajectory::AddTremble() {
  constexpr int kBands = 8;
  RandomStream random(Hash(options_.seed, 72));
  for (auto* waves : {&position_, &rotation_}) {
    const double rms = waves == &position_ ? options_.tremble_m : options_.tremble_rad;
    std::array<std::vector<Wave>, 3> tremble;
    double power = 0;
    for (std::vector<Wave>& axis : tremble) {
      for (int band = 0; band < kBands; ++band) {
        const double frequency = std::pow(10.0, (band + random.Uniform()) / kBands);
        const double amplitude = random.Uniform(0.5, 1.5) / frequency;
        axis.push_back({amplitude, frequency, random.Uniform(0.0, kTwoPi)});
        power += 0.5 * amplitude * amplitude;
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (Wave& wave : tremble[axis]) {
        wave.amplitude *= rms / std::sqrt(power);
        (*waves)[axis].push_back(wave);
      }
    }
  }
}

Pose Trajectory::T_world_camera(double time_s) const {
  if (options_.at_rest) {
    const SensorAtPlace& place = *options_.at_rest;
    constexpr double kPush_s = 0.1;
    const double pushed = std::clamp((time_s - place.pushed_at_s) / kPush_s, 0.0, 1.0);
    Pose T = place.T_world_camera * Interpolate(Pose::Identity(), place.T_before_after, pushed);
    constexpr double kSway_hz = 2.0;
    T.translate(Eigen::Vector3d(place.sway_m * std::sin(kTwoPi * kSway_hz * time_s), 0.0, 0.0));
    return T;
  }
  const double along = options_.half_way_m * (2.0 * SoftRamp(time_s / options_.duration_s) - 1.0);
  const double swing =
      options_.swing_m * std::sin(kTwoPi * time_s / options_.swing_period_s + swing_phase_);
  const Eigen::Vector3d position(along + Sum(position_[0], time_s),
                                 swing + Sum(position_[1], time_s),
                                 options_.height_m + Sum(position_[2], time_s));

  // The hand turns the sensor back towards the body's axis as it swings out. Camera: x to the
  // body's left, y to the feet, z down.
  const Eigen::Vector3d target(along, 0.25 * swing, 0.08);
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX().cross(z).normalized();
  Pose T_sweep_camera = Pose::Identity();
  T_sweep_camera.linear().col(0) = x;
  T_sweep_camera.linear().col(1) = z.cross(x);
  T_sweep_camera.linear().col(2) = z;
  T_sweep_camera.linear() *= RotationFromVector(
      {Sum(rotation_[0], time_s), Sum(rotation_[1], time_s), Sum(rotation_[2], time_s)});
  T_sweep_camera.translation() = position;
  return options_.T_world_sweep * T_sweep_camera;
}

}  // namespace plumb::simulated
