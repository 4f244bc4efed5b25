// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/monitor.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/comparison/motion_uncertainty.hpp"

namespace plumb {
namespace {

using Eigen::Vector3d;

constexpr double kLeastVisible = 0.6;
constexpr double kLeastInformation = 0.5;
constexpr double kMostResidual = 1.5;
constexpr double kUnguarded_s = 10.0;
// Errors of the sensor that do not change with time cancel at the zero and grow with the distance
// from it, as far as they belong together.
constexpr double kStaticReach_m = 10 * kMillimetre;
constexpr double kOfMotion = 0.003;  // scale errors of depth and map
// What no longer cancels does so in patches: of the sensor's own error this share remains of the
// mean over the body, and turns it as over this length.
constexpr double kStaticShare = 0.1;
constexpr double kStaticLever_m = 0.25;
// A rotation moves what is seen as a shift does over this length.
constexpr double kTurnReach_m = 0.2;
// The median of absolute residuals as a standard deviation, and the least that is divided by.
constexpr double kSigmasOfResidual = 1.5, kLeastResidual = 0.1;
// Neighbouring frames of the zero share their errors: so many count as one, and never fewer than
// four as independent.
constexpr double kFramesThatAreOne = 4.0, kFewestInZero = 4.0;
// Share of the static error's square that belongs together over the body.
constexpr double kStaticCorrelation = 0.25;
// The numbers are means over this time, of the frames that agree with the newest.
constexpr double kMean_s = 0.4;
constexpr double kAgree = 3.0;  // standard deviations
// Sensors that are mounted within this time after the first one are zeroed with it.
constexpr double kMountTogether_s = 1.0;
constexpr double kAway_s = 1.0;     // without an image: it may have been moved meanwhile
constexpr int kChecksOnReturn = 3;  // as many images as its place is judged by
// The fits at rest are spread over about this time for each sensor: each set of them is fitted.
constexpr double kFitting_s = 0.6;
// A body may begin to move ten seconds after the first frame: from nine on a whole breath is
// enough, after this time of zeroing. It is looked for that often.
constexpr double kHurry_s = 9.0;
constexpr double kTooLate_s = 10.0;
constexpr double kFirstTry_s = 5.0;
constexpr double kTryAgain_s = 0.25;
// Motion between the sweep and the zero according to depth alone: up to 8.0 mm and 0.53 deg for a
// body that lay still (21 zeros of 7 simulated units). Beyond these limits the result of the sweep
// no longer applies.
constexpr double kMovedSinceScan_m = 15 * kMillimetre;
constexpr double kTurnedSinceScan_rad = 1.5 * kDegree;

bool HasMovedSinceScan(const Pose& T_since_scan, const Vector3d& body_m) {
  return (T_since_scan * body_m - body_m).norm() > kMovedSinceScan_m ||
         RotationAngle(T_since_scan) > kTurnedSinceScan_rad;
}

}  // namespace

LiveNumbers NumbersOfMotion(const Pose& T_motion, const Matrix6d& covariance, const Vector3d& point,
                            const std::optional<Pose>& T_iec_reference) {
  const Pose T_axes = T_iec_reference.value_or(Pose::Identity());
  // A correction undoes a motion: that of the inverse is the motion itself.
  const auto numbers = [&](const Pose& T) { return CouchVector(T.inverse(), point, T_axes); };
  constexpr double kStep = 1e-6;
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    const Vector6d step = kStep * Vector6d::Unit(i);
    jacobian.col(i) = (numbers(PoseAbout(T_motion * point, step) * T_motion) -
                       numbers(PoseAbout(T_motion * point, -step) * T_motion)) /
                      (2 * kStep);
  }
  return {
      .value = numbers(T_motion),
      .u95 = kCover95 *
             (jacobian * covariance * jacobian.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt()};
}

Monitor::Monitor(const Scene& scene, std::span<const StreamInfo> sensors,
                 const MonitorOptions& options)
    : options_(options), scene_(scene, options.region_polygon_m), advice_(options.limits) {
  for (const StreamInfo& info : sensors) sensors_.push_back({.at_rest = {info, scene_}});
}

Vector6d Monitor::spread_at_zero() const {
  // Of the largest set, which is that of all sensors with a zero.
  const auto largest = std::max_element(
      at_rest_.begin(), at_rest_.end(),
      [](const auto& a, const auto& b) { return a.first.size() < b.first.size(); });
  return largest == at_rest_.end() ? Vector6d(Vector6d::Zero()) : largest->second.spread;
}

SensorShare Monitor::share(std::size_t i) const {
  const Sensor& sensor = sensors_.at(i);
  if (!sensor.takes_part) return SensorShare::kLeftOut;
  if (sensor.moved) return SensorShare::kMoved;
  if (stage_ != Stage::kFollowing || !zero_time_s_) return SensorShare::kUsed;
  // Right after the zero, not every sensor has sent a frame.
  if (last_s_ - sensor.image_s.value_or(*zero_time_s_) > kLongestGap_s)
    return SensorShare::kNoImage;
  if (sensor.checks_due > 0) return SensorShare::kNoImage;  // none that is used yet
  const bool is_used = std::ranges::find(used_, i) != used_.end();
  return is_used || !sensor.image_s ? SensorShare::kUsed : SensorShare::kCovered;
}

std::optional<LiveMap> Monitor::Map() const {
  std::vector<FitView> views;
  for (const std::size_t i : SensorsThatMaySee(last_s_))
    views.push_back(sensors_[i].at_rest.view(sensors_[i].modes_m));
  if (views.empty()) return std::nullopt;
  return MakeLiveMap(views);
}

std::optional<MonitorLine> Monitor::Add(const Frame& frame, std::size_t index) {
  Sensor& sensor = sensors_.at(index);
  if (!first_s_) first_s_ = frame.depth_time_s;
  last_s_ = frame.depth_time_s;
  MonitorLine line{.time_s = frame.depth_time_s, .sensor = index};
  const bool any =
      std::ranges::any_of(sensors_, [](const Sensor& one) { return one.takes_part && !one.moved; });
  if (any && (!sensor.takes_part || sensor.moved)) return std::nullopt;
  if (no_zero_) {
    line.state = MonitorState::kBlind;
    line.reason = BlindReason::kNoZero;
  } else {
    switch (stage_) {
      case Stage::kMounting:
        Mount(sensor, frame);
        break;
      case Stage::kZeroing:
        line.state = MonitorState::kZeroing;
        Collect(sensor, frame);
        break;
      case Stage::kFitting:
        line.state = MonitorState::kZeroing;
        FitSome();
        break;
      case Stage::kFollowing:
        if (!Follow(sensor, frame, line)) return std::nullopt;
        break;
    }
  }
  const bool knows = line.state == MonitorState::kMonitoring;
  line.advice = advice_.Next(line.time_s, !knows                      ? std::nullopt
                                          : options_.judges_reference ? line.against_reference
                                                                      : line.since_zero);
  return line;
}

MonitorLine Monitor::LineAside(const Frame& frame, std::size_t index) const {
  const Sensor& sensor = sensors_.at(index);
  MonitorLine line{.time_s = frame.depth_time_s, .sensor = index, .takes_part = false};
  if (sensor.moved) {
    line.state = MonitorState::kMovedSensor;
  } else if (sensor.takes_part) {  // Add() took its image for a repetition.
    line.state = MonitorState::kBlind;
  } else if (sensor.at_rest.stage() != RestStage::kMounting) {
    line.state = MonitorState::kBlind;
    line.reason = BlindReason::kNoZero;
  }
  return line;
}

void Monitor::Mount(Sensor& sensor, const Frame& frame) {
  const auto mounted = [](const Sensor& one) {
    return one.at_rest.stage() != RestStage::kMounting;
  };
  if (!mounted(sensor)) sensor.at_rest.Mount(frame);
  if (!mounted_since_s_ && mounted(sensor)) mounted_since_s_ = frame.depth_time_s;
  if (!mounted_since_s_) return;
  if (!std::ranges::all_of(sensors_, mounted) &&
      frame.depth_time_s - *mounted_since_s_ < kMountTogether_s)
    return;
  for (Sensor& one : sensors_) one.takes_part = mounted(one);
  stage_ = Stage::kZeroing;
}

void Monitor::Collect(Sensor& sensor, const Frame& frame) {
  if (!zeroing_since_s_) zeroing_since_s_ = frame.depth_time_s;
  sensor.at_rest.AddStill(frame);
  const double age_s = frame.depth_time_s - *zeroing_since_s_;
  const bool last = age_s >= options_.zeroing_s;
  const double since_first_s = frame.depth_time_s - *first_s_;
  const bool due = age_s >= kFirstTry_s && since_first_s >= kHurry_s &&
                   since_first_s <= kTooLate_s &&
                   (!zero_tried_s_ || frame.depth_time_s - *zero_tried_s_ >= kTryAgain_s);
  if (!last && !due) return;
  zero_tried_s_ = frame.depth_time_s;
  TakeZeros(last);
}

void Monitor::TakeZeros(bool last) {
  const auto zeroes = [last](Sensor& one) {
    return one.takes_part && one.at_rest.Zero(last ? ZeroKind::kAny : ZeroKind::kOfWholeBreath);
  };
  std::vector<std::pair<std::size_t, const SensorAtRest*>> zeroed;
  std::size_t frames = 0;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    Sensor& sensor = sensors_[i];
    const bool has_zero = zeroes(sensor);
    if (sensor.takes_part && !has_zero && !last) return;  // All of them begin together.
    sensor.takes_part = has_zero;
    if (!sensor.takes_part) continue;
    zeroed.emplace_back(i, &sensor.at_rest);
    frames += sensor.at_rest.still_times_s().size();
  }
  const std::size_t num_zeroed = zeroed.size();
  // For good, whichever of the sensors see the body later.
  moved_since_scan_ = std::ranges::any_of(zeroed, [this](const auto& one) {
    return HasMovedSinceScan(one.second->since_scan().T, scene_.centroid_m);
  });
  if (!zeroed.empty()) rest_fits_.emplace(std::move(zeroed), scene_.centroid_m);
  no_zero_ = !rest_fits_ || rest_fits_->size() == 0;
  if (no_zero_) return;
  const double frames_of_fitting =
      std::max(1.0, static_cast<double>(frames * num_zeroed) * kFitting_s /
                        std::max(kFirstTry_s, *zero_tried_s_ - *zeroing_since_s_));
  fits_at_a_time_ = static_cast<std::size_t>(
      std::ceil(static_cast<double>(rest_fits_->size()) / frames_of_fitting));
  stage_ = Stage::kFitting;
}

void Monitor::FitSome() {
  if (!rest_fits_->Make(fits_at_a_time_)) return;
  at_rest_ = rest_fits_->Statistics();
  rest_fits_.reset();
  stage_ = Stage::kFollowing;
}

Matrix6d Monitor::CovarianceOf(const MotionFit& fit, const SensorSet& set,
                               std::size_t frames) const {
  const RestStatistics& at_rest = at_rest_.at(set);
  const Matrix6d formal = FormalCovariance(fit);
  // Between the share of a single frame, which is 1, and that of a mean.
  const double weight =
      (1.0 / static_cast<double>(std::min(frames, kFramesOfMean)) - 1.0 / kFramesOfMean) /
      (1.0 - 1.0 / kFramesOfMean);
  const Vector6d of_mean = (at_rest.share_of_mean.array() * (1.0 - weight) + weight).sqrt();
  const Vector6d scale = at_rest.inflation.cwiseProduct(of_mean);
  const Matrix6d frame = scale.asDiagonal() * formal * scale.asDiagonal();
  const Matrix6d single = at_rest.inflation.asDiagonal() * formal * at_rest.inflation.asDiagonal();
  const Pose since_zero = fit.T * at_rest.T_zero.inverse();
  const double shift_m = (since_zero * scene_.centroid_m - scene_.centroid_m).norm() +
                         kTurnReach_m * RotationAngle(since_zero);
  // Adds the uncertainty of the zero, and of what is static in the sensor's errors and no longer
  // cancels after a motion.
  std::size_t frames_in_zero = 0;
  double ratio = 0, static_m = 0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const SensorAtRest& sensor = sensors_[set[i]].at_rest;
    frames_in_zero += sensor.frames_in_zero();
    static_m = std::max(static_m, sensor.static_error_m());
    ratio = std::max(ratio, sensor.static_error() /
                                std::max(kLeastResidual, kSigmasOfResidual * at_rest.residual[i]));
  }
  const double of_zero =
      1.0 / std::max(kFewestInZero, static_cast<double>(frames_in_zero) / kFramesThatAreOne);
  const double share = std::min(1.0, shift_m / kStaticReach_m);
  const double of_static = kStaticCorrelation * share * share * ratio * ratio;
  Matrix6d covariance = frame + (of_zero + of_static) * single;
  const double of_motion_m = std::hypot(kOfMotion * shift_m, kStaticShare * share * static_m);
  covariance.bottomRightCorner<3, 3>().diagonal().array() += of_motion_m * of_motion_m;
  const double of_motion_rad = kStaticShare * share * static_m / kStaticLever_m;
  covariance.topLeftCorner<3, 3>().diagonal().array() += of_motion_rad * of_motion_rad;
  return covariance;
}

SensorSet Monitor::SensorsThatMaySee(double time_s) const {
  SensorSet set;
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    const Sensor& sensor = sensors_[i];
    if (sensor.takes_part && !sensor.moved && sensor.checks_due == 0 && sensor.image_s &&
        time_s - *sensor.image_s <= kLongestGap_s)
      set.push_back(i);
  }
  return set;
}

BlindReason Monitor::JudgeOne(std::size_t sensor, const ViewFit& fit, double residual_at_rest,
                              double time_s) const {
  if (fit.visible() < kLeastVisible) return BlindReason::kCovered;
  if (!(fit.residual <= kMostResidual * residual_at_rest)) return BlindReason::kMisfit;
  if (time_s - *sensors_[sensor].markers_s > kUnguarded_s) return BlindReason::kUnguarded;
  return BlindReason::kNone;
}

std::optional<MotionFit> Monitor::FitAll(SensorSet& set, MonitorLine& line) {
  while (!set.empty()) {
    const auto found = at_rest_.find(set);
    if (found == at_rest_.end()) {  // too few frames of them together
      set.pop_back();
      continue;
    }
    const RestStatistics& at_rest = found->second;
    std::vector<FitView> views;
    for (const std::size_t i : set) views.push_back(sensors_[i].at_rest.view(sensors_[i].modes_m));
    MotionFit fit = FitMotion(views, scene_.centroid_m, {.T = T_last_});
    line.visible = fit.visible();
    line.residual = 0;
    line.reason = fit.converged                  ? BlindReason::kNone
                  : line.visible < kLeastVisible ? BlindReason::kCovered
                                                 : BlindReason::kMisfit;
    // The one that sees the least of its own leaves first; what it sees may be something else.
    std::size_t worst = 0;
    for (std::size_t i = 0; i < set.size(); ++i) {
      const ViewFit& view = fit.views[i];
      line.residual = std::max(line.residual, view.residual / at_rest.residual[i]);
      if (view.visible() < fit.views[worst].visible()) worst = i;
    }
    for (std::size_t i = 0; i < set.size() && line.reason == BlindReason::kNone; ++i) {
      line.reason = JudgeOne(set[i], fit.views[i], at_rest.residual[i], line.time_s);
      if (line.reason != BlindReason::kNone) worst = i;
    }
    if (line.reason == BlindReason::kNone) {
      const Matrix6d information = FormalCovariance(fit).inverse();
      const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix6d> solver(
          information, at_rest.information, Eigen::EigenvaluesOnly);
      if (solver.eigenvalues().minCoeff() >= kLeastInformation) return fit;
      line.reason = BlindReason::kWeak;
    }
    set.erase(set.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  return std::nullopt;
}

bool Monitor::Follow(Sensor& sensor, const Frame& frame, MonitorLine& line) {
  if (!zero_time_s_) {
    zero_time_s_ = frame.depth_time_s;
    for (Sensor& one : sensors_) one.markers_s = frame.depth_time_s;
  }
  if (frame.depth_time_s - sensor.image_s.value_or(*zero_time_s_) > kAway_s) {
    sensor.at_rest.ForgetPlace();
    sensor.checks_due = kChecksOnReturn;
  }
  const SeenImage seen = sensor.at_rest.See(frame);
  if (seen == SeenImage::kRepeated) return false;
  sensor.image_s = frame.depth_time_s;
  const PlaceCheck& check = sensor.at_rest.check();
  constexpr int kLeastMarkers = 3;
  if (check.num_seen >= kLeastMarkers) {
    sensor.markers_s = frame.depth_time_s;
    if (seen == SeenImage::kChecked && sensor.checks_due > 0) --sensor.checks_due;
  }
  line.markers_seen = check.num_seen;
  line.couch_moved = check.couch_moved;
  line.drift = sensor.at_rest.drift();
  line.support_rise_m = sensor.at_rest.support_rise_m();
  sensor.moved = sensor.moved || check.sensor_moved;
  if (std::ranges::none_of(sensors_,
                           [](const Sensor& one) { return one.takes_part && !one.moved; })) {
    line.state = MonitorState::kMovedSensor;
    return true;
  }
  SensorSet set = SensorsThatMaySee(line.time_s);
  // Only one that was just pushed, or whose place is not known again.
  if (set.empty())
    line.reason = sensor.checks_due > 0 ? BlindReason::kUnguarded : BlindReason::kCovered;
  const std::optional<MotionFit> fit = FitAll(set, line);
  used_ = fit ? set : SensorSet();
  if (!fit) {
    line.state = MonitorState::kBlind;
    recent_.clear();
    return true;
  }
  line.state = MonitorState::kMonitoring;
  line.sensors_used = static_cast<int>(set.size());
  if (set != last_set_) recent_.clear();  // its zero and its scatter are others
  last_set_ = set;
  T_last_ = fit->T;
  const auto [T_motion, frames] = MeanMotion(line.time_s, *fit, at_rest_.at(set));
  const Matrix6d covariance = CovarianceOf(*fit, set, frames);
  line.since_zero =
      NumbersOfMotion(T_motion, covariance, scene_.centroid_m, options_.T_iec_reference);
  if (options_.accepted) {
    if (moved_since_scan_)
      line.reason = BlindReason::kNoZero;
    else
      line.against_reference = AgainstReference(T_motion, covariance);
  }
  for (std::size_t i = 0; i < set.size(); ++i) sensors_[set[i]].modes_m = fit->views[i].modes_m;
  line.breathing_m = Breathing_m(set);
  return true;
}

std::optional<double> Monitor::Breathing_m(const SensorSet& set) const {
  double sum_m = 0, count = 0;
  for (const std::size_t i : set) {
    const Sensor& sensor = sensors_[i];
    if (!sensor.at_rest.breathing()) continue;
    sum_m += sensor.at_rest.breathing()->Belly_m(sensor.modes_m);
    count += 1;
  }
  return count > 0 ? std::optional(sum_m / count) : std::nullopt;
}

std::pair<Pose, std::size_t> Monitor::MeanMotion(double time_s, const MotionFit& fit,
                                                 const RestStatistics& at_rest) {
  const Vector6d newest = TwistAbout(fit.T * at_rest.T_zero.inverse(), scene_.centroid_m);
  recent_.emplace_back(time_s, newest);
  std::erase_if(recent_, [&](const auto& one) { return time_s - one.first > kMean_s; });
  // One that disagrees ends the time over which the body lay still.
  Vector6d sum = Vector6d::Zero();
  std::size_t count = 0;
  for (auto one = recent_.rbegin(); one != recent_.rend(); ++one) {
    const Vector6d off = (one->second - newest).cwiseQuotient(std::sqrt(2.0) * at_rest.spread);
    if (off.cwiseAbs().maxCoeff() > kAgree) break;
    sum += one->second;
    ++count;
  }
  recent_.erase(recent_.begin(), recent_.end() - static_cast<std::ptrdiff_t>(count));
  return {PoseAbout(scene_.centroid_m, sum / static_cast<double>(count)), count};
}

LiveNumbers Monitor::AgainstReference(const Pose& T_motion, const Matrix6d& covariance) const {
  const AcceptedMotion& accepted = *options_.accepted;
  const Pose& T = accepted.T_reference_current;
  const Pose T_live = T * T_motion * T.inverse();
  const Vector3d at_scan = accepted.T_motion * accepted.centroid_m;
  const Vector3d moved = T_live * at_scan;
  const Matrix6d of_live = CovarianceAbout(CovarianceTurned(covariance, T.linear()),
                                           T * (T_motion * scene_.centroid_m), moved);
  const Matrix6d of_result = CovarianceTurned(accepted.covariance, T_live.linear());
  return NumbersOfMotion(T_live * accepted.T_motion, of_live + of_result, accepted.centroid_m,
                         options_.T_iec_reference);
}

}  // namespace plumb
