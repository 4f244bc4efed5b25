// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/shared_sensor.hpp"

#include <algorithm>
#include <vector>

#include <Eigen/Cholesky>

#include "algo/sensor_calibration/profile_gate.hpp"
#include "algo/sensor_calibration/sensor_profile.hpp"

namespace plumb {
namespace {

using Effect = Eigen::Matrix<double, 6, Eigen::Dynamic>;  // A twist per unit of each term.

constexpr std::size_t kMinPatches = 4;
constexpr std::size_t kMinMarkers = 3;
// The shift of marker edges depends on the light of each scan. A sweep's estimate of the colour
// image's readout time depends on the tremor of the hand: over ten sweeps of one simulated unit it
// scatters by 1.7 ms, fourteen times what the residuals indicate.
constexpr double kEdgeDrift_px = 1.0;
constexpr double kReadoutScatter_s = 0.002;
// Between the reference and a fraction a sensor may have warmed up: its depth scale then differs by
// up to 0.6 %, four times the difference between two consecutive sweeps.
constexpr double kWarmth = 4.0;

struct Point {
  Eigen::Vector3d p;
  Eigen::MatrixXd moves;  // 3 rows, metres per unit of each term.
  double weight;
};

// The rigid motion that points make together, about a centre.
std::optional<Effect> RigidPart(const std::vector<Point>& points, std::size_t needed,
                                const Eigen::Vector3d& centre) {
  if (points.size() < needed) return std::nullopt;
  Matrix6d H = Matrix6d::Zero();
  Effect g = Effect::Zero(6, points.front().moves.cols());
  for (const Point& point : points) {
    const Matrix3x6d J = PointJacobian(point.p - centre);
    H += point.weight * J.transpose() * J;
    g += point.weight * J.transpose() * point.moves;
  }
  const Eigen::LDLT<Matrix6d> solver(H);
  if (solver.info() != Eigen::Success || !(solver.rcond() > 1e-9)) return std::nullopt;
  return solver.solve(g);
}

std::vector<Point> MarkersOf(const Scene& scene, const std::vector<int>& ids, const Pose& T) {
  std::vector<Point> points;
  for (const int id : ids) {
    const auto moves = scene.sensitivity->markers.find(id);
    const auto marker = scene.markers.find(id);
    if (moves == scene.sensitivity->markers.end() || marker == scene.markers.end()) continue;
    const Eigen::Vector3d centre = CentreOf(marker->second.corners);
    const double sigma = std::max(marker->second.sigma_m, 1e-4);
    points.push_back(
        {T * centre, T.linear() * moves->second.cast<double>(), 1.0 / (sigma * sigma)});
  }
  return points;
}

// Patches of the body's region. @param T  To the reference frame. @param T_body  From there to
// where the reference body lies.
std::vector<Point> SurfaceOf(const Scene& scene, const Pose& T, const Pose& T_body,
                             const SharedSensorInput& input) {
  std::vector<Point> points;
  for (const SensorSensitivity::Patch& patch : scene.sensitivity->surface) {
    const Eigen::Vector3d p = T * patch.centre_m.cast<double>();
    if (!input.in_region(T_body * p)) continue;
    points.push_back({p, T.linear() * patch.derivative.cast<double>(), patch.weight});
  }
  return points;
}

// Terms of the calibration that both sweeps estimated.
std::vector<Eigen::Index> FreeTerms(const SensorSensitivity& a, const SensorSensitivity& b) {
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < kCalibrationSize; ++i)
    if (a.covariance(i, i) > 0 && b.covariance(i, i) > 0) free.push_back(i);
  return free;
}

// Whether the same unit may have made both scans, by what is known before their estimates are
// compared.
bool MayBeOneUnit(const SensorSensitivity& a, const SensorSensitivity& b) {
  if (a.stated != b.stated) return false;
  if (!a.serial.empty() && !b.serial.empty()) return a.serial == b.serial;
  return a.stated_for_this_unit && b.stated_for_this_unit;
}

Eigen::VectorXd DriftVariance(const std::vector<Eigen::Index>& terms) {
  CalibrationVector sigma = DriftBetweenSweeps();
  sigma[kEdgeBiasAt] = kEdgeDrift_px;
  sigma[kReadoutAt] = kReadoutScatter_s;
  for (const int term : {kDepthScale, kDepthOffset, kDepthBow}) sigma[kDepthAt + term] *= kWarmth;
  sigma.segment<kNumGrowthTerms>(kDepthAt + kDepthGrowth) *= kWarmth;
  return sigma.cwiseAbs2()(terms);
}

// By how much the current body moves against its markers, about the moved centroid.
std::optional<Effect> EffectOnCurrent(const SharedSensorInput& input) {
  const Eigen::Vector3d moved = input.T_motion * input.centroid_m;
  const Pose& T = input.alignment.T_reference_current;
  const auto markers =
      RigidPart(MarkersOf(input.current, input.alignment.markers_used, T), kMinMarkers, moved);
  const auto body =
      RigidPart(SurfaceOf(input.current, T, input.T_motion.inverse(), input), kMinPatches, moved);
  if (!markers || !body) return std::nullopt;
  return *body - *markers;
}

// By how much the motion changes with the reference's calibration: its markers' part less that of
// its body, which moves with it.
std::optional<Effect> EffectOfReference(const SharedSensorInput& input,
                                        const std::vector<int>& marker_ids) {
  const Pose& M = input.T_motion;
  const auto markers = RigidPart(MarkersOf(input.reference, marker_ids, Pose::Identity()),
                                 kMinMarkers, M * input.centroid_m);
  const auto body = RigidPart(SurfaceOf(input.reference, Pose::Identity(), Pose::Identity(), input),
                              kMinPatches, input.centroid_m);
  if (!markers || !body) return std::nullopt;
  Effect body_moved(6, kCalibrationSize);
  body_moved.topRows<3>() = M.linear() * body->topRows<3>();
  body_moved.bottomRows<3>() = M.linear() * body->bottomRows<3>();
  return *markers - body_moved;
}

Matrix6d CovarianceOf(const Effect& effect, const SensorSensitivity& sensor) {
  const std::vector<Eigen::Index> free = FreeTerms(sensor, sensor);
  const Effect G = effect(Eigen::all, free);
  return kSharedErrors * kSharedErrors * G * sensor.covariance(free, free) * G.transpose();
}

// Scans that state the same unit and contradict each other: what moved the estimates apart, such as
// depth that one program registered otherwise, is in neither model, and the errors are as large as
// the contradiction. A delay may differ: the model has all of it.
// @param S  Covariance of the difference of the free terms.
// @return the factor for the covariance, at least 1.
double Contradiction(const SensorSensitivity& r, const SensorSensitivity& c,
                     const std::vector<Eigen::Index>& free, const Eigen::MatrixXd& S) {
  std::vector<Eigen::Index> terms, at;
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (free[i] == kDepthAt + kDepthDelay) continue;
    terms.push_back(free[i]);
    at.push_back(static_cast<Eigen::Index>(i));
  }
  if (terms.empty()) return 1.0;
  const Eigen::VectorXd difference = (c.estimate - r.estimate)(terms);
  const double chi2 = difference.dot(Eigen::MatrixXd(S(at, at)).llt().solve(difference));
  const auto num_terms = static_cast<int>(terms.size());
  return chi2 > ChiSquareLimit(num_terms) ? std::max(1.0, chi2 / num_terms) : 1.0;
}

}  // namespace

std::optional<Matrix6d> SensorAlone(const SharedSensorInput& input) {
  if (!input.current.sensitivity) return std::nullopt;
  const SensorSensitivity& c = *input.current.sensitivity;
  if (c.estimate.size() != kCalibrationSize) return std::nullopt;
  const std::optional<Effect> effect = EffectOnCurrent(input);
  if (!effect) return std::nullopt;
  return CovarianceOf(*effect, c);
}

std::optional<Matrix6d> SensorsApart(const SharedSensorInput& input,
                                     const std::vector<int>& reference_markers) {
  const std::optional<Matrix6d> current = SensorAlone(input);
  if (!current || !input.reference.sensitivity) return std::nullopt;
  const SensorSensitivity& r = *input.reference.sensitivity;
  if (r.estimate.size() != kCalibrationSize) return std::nullopt;
  const std::optional<Effect> effect = EffectOfReference(input, reference_markers);
  if (!effect) return std::nullopt;
  return Matrix6d(*current + CovarianceOf(*effect, r));
}

std::optional<SharedSensor> JoinSensors(const SharedSensorInput& input) {
  if (!input.reference.sensitivity || !input.current.sensitivity) return std::nullopt;
  const SensorSensitivity& r = *input.reference.sensitivity;
  const SensorSensitivity& c = *input.current.sensitivity;
  if (r.estimate.size() != kCalibrationSize || c.estimate.size() != kCalibrationSize)
    return std::nullopt;
  const std::optional<Effect> reference = EffectOfReference(input, input.alignment.markers_used);
  const std::optional<Effect> current = EffectOnCurrent(input);
  if (!reference || !current) return std::nullopt;

  // M' = exp(a_r) T exp(-a_c) exp(b_c) T^-1 M exp(-b_r), to first order and about the moved
  // centroid: a are the markers' twists, b the body's.
  const std::vector<Eigen::Index> free = FreeTerms(r, c);
  const Effect G_r = (*reference)(Eigen::all, free);
  const Effect G_c = (*current)(Eigen::all, free);

  const Eigen::MatrixXd P_r = kSharedErrors * kSharedErrors * r.covariance(free, free);
  const Eigen::MatrixXd P_c = kSharedErrors * kSharedErrors * c.covariance(free, free);
  SharedSensor result;
  result.covariance = G_r * P_r * G_r.transpose() + G_c * P_c * G_c.transpose();
  if (!MayBeOneUnit(r, c)) return result;

  Eigen::MatrixXd S = P_r + P_c;
  S.diagonal() += DriftVariance(free);
  const Eigen::LDLT<Eigen::MatrixXd> solver(S);
  if (solver.info() != Eigen::Success) return result;
  const Eigen::VectorXd difference = (c.estimate - r.estimate)(free);
  const Eigen::VectorXd weighted = solver.solve(difference);
  if (!(difference.dot(weighted) <= ChiSquareLimit(static_cast<int>(free.size())))) {
    result.covariance *= Contradiction(r, c, free, S);
    return result;
  }
  result.one_unit = true;
  result.correction = G_r * (P_r * weighted) - G_c * (P_c * weighted);
  // Effect of both estimates on the motion; joining them removes part of its covariance.
  const Effect gain = G_r * P_r - G_c * P_c;
  result.covariance -= gain * solver.solve(gain.transpose());
  return result;
}

}  // namespace plumb
