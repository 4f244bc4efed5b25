// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/sensor_place.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <opencv2/core/types.hpp>

#include "algo/base/robust_weights.hpp"
#include "algo/base/units.hpp"
#include "algo/markers/camera_pose.hpp"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kLeastMarkers = 4;
constexpr double kAgreement_px = 3.0;  // at 640 columns
constexpr std::size_t kImagesJudged = 3;
constexpr double kShift_m = 0.5 * kMillimetre;
constexpr double kTurn_rad = 0.05 * kDegree;
constexpr double kSurely = 5.0;  // standard deviations

/// A corner in space and where it was seen.
struct Sighting {
  int id = 0;
  Vector3d p;
  Vector2d pixel;
};

std::optional<Pose> FirstPlace(const std::vector<Sighting>& sightings, const Intrinsics& camera) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> ideal;
  for (const Sighting& s : sightings) {
    const Vector2d u = Undistort(camera, s.pixel);
    points.emplace_back(s.p.x(), s.p.y(), s.p.z());
    ideal.emplace_back(u.x(), u.y());
  }
  return PoseFromPoints(points, ideal);
}

using Matrix2x6d = Eigen::Matrix<double, 2, 6>;

// Of the pixel of a point in the camera frame, to a twist on its left.
Matrix2x6d PixelJacobian(const Intrinsics& camera, const Vector3d& p) {
  constexpr double kStep = 1e-6;
  Eigen::Matrix<double, 2, 3> by_point;
  for (int i = 0; i < 3; ++i) {
    const Vector3d step = kStep * Vector3d::Unit(i);
    by_point.col(i) = (Project(camera, p + step) - Project(camera, p - step)) / (2 * kStep);
  }
  return by_point * PointJacobian(p);
}

// Gauss-Newton with Cauchy weights for the pose that brings the points to their pixels.
void Refine(Pose& T, const std::vector<Sighting>& sightings, const Intrinsics& camera,
            double scale_px) {
  for (int iteration = 0; iteration < 15; ++iteration) {
    Matrix6d left = Matrix6d::Zero();
    Vector6d right = Vector6d::Zero();
    for (const Sighting& s : sightings) {
      const Vector3d p = T * s.p;
      if (!(p.z() > 0.05)) continue;
      const Vector2d error = s.pixel - Project(camera, p);
      const Matrix2x6d J = PixelJacobian(camera, p);
      const double weight = CauchyWeight(error.squaredNorm(), scale_px);
      left += weight * J.transpose() * J;
      right += weight * J.transpose() * error;
    }
    const Vector6d step = left.ldlt().solve(right);
    if (!step.allFinite()) return;
    T = PoseFromTwist(step) * T;
    if (step.norm() < 1e-8) break;
  }
  T = Orthonormalised(T);
}

double ErrorOf(const Pose& T, const Sighting& s, const Intrinsics& camera) {
  const Vector3d p = T * s.p;
  return p.z() > 0.05 ? (s.pixel - Project(camera, p)).norm() : 1e9;
}

std::vector<Sighting> SightingsOf(const SeenCorners& seen, const MarkerMap& scene) {
  std::vector<Sighting> sightings;
  for (const auto& [id, corners] : seen) {
    const auto known = scene.find(id);
    if (known == scene.end()) continue;
    for (std::size_t c = 0; c < 4; ++c)
      sightings.push_back({id, known->second.corners[c], corners[c]});
  }
  return sightings;
}

}  // namespace

std::optional<SensorPlace> PlaceByMarkers(const SeenCorners& seen, const MarkerMap& scene,
                                          const Intrinsics& camera) {
  std::vector<Sighting> sightings = SightingsOf(seen, scene);
  const double px = camera.width / 640.0;
  // Without the marker that fits worst, until the others agree.
  while (sightings.size() >= 4 * kLeastMarkers) {
    std::optional<Pose> T = FirstPlace(sightings, camera);
    if (!T) return std::nullopt;
    Refine(*T, sightings, camera, px);
    std::map<int, double> worst;
    double squares = 0;
    for (const Sighting& s : sightings) {
      const double error = ErrorOf(*T, s, camera);
      worst[s.id] = std::max(worst[s.id], error);
      squares += error * error;
    }
    const auto bad = std::max_element(worst.begin(), worst.end(), [](const auto& a, const auto& b) {
      return a.second < b.second;
    });
    if (bad->second <= kAgreement_px * px) {
      SensorPlace place{.T_camera_scene = *T};
      for (const auto& [id, error] : worst) place.markers.push_back(id);
      place.residual_px = std::sqrt(squares / static_cast<double>(sightings.size()));
      return place;
    }
    std::erase_if(sightings, [&](const Sighting& s) { return s.id == bad->first; });
  }
  return std::nullopt;
}

void CornerMeans::Add(const SeenCorners& seen) {
  ++num_images_;
  for (const auto& [id, corners] : seen) {
    auto [at, is_new] = sums_.try_emplace(id);
    if (is_new) {
      at->second.sum.fill(Vector2d::Zero());
      at->second.squares.fill(Vector2d::Zero());
    }
    for (std::size_t c = 0; c < 4; ++c) {
      at->second.sum[c] += corners[c];
      at->second.squares[c] += corners[c].cwiseProduct(corners[c]);
    }
    ++at->second.count;
  }
}

SeenCorners CornerMeans::Means() const {
  SeenCorners means;
  for (const auto& [id, sum] : sums_) {
    if (2 * sum.count < num_images_) continue;
    for (std::size_t c = 0; c < 4; ++c) means[id][c] = sum.sum[c] / sum.count;
  }
  return means;
}

double CornerMeans::Scatter_px() const {
  double variance = 0;
  int count = 0;
  for (const auto& [id, sum] : sums_) {
    if (2 * sum.count < num_images_ || sum.count < 2) continue;
    for (std::size_t c = 0; c < 4; ++c) {
      const Vector2d mean = sum.sum[c] / sum.count;
      variance += (sum.squares[c] / sum.count - mean.cwiseProduct(mean)).cwiseMax(0.0).sum() *
                  sum.count / (sum.count - 1);
      count += 2;
    }
  }
  return count > 0 ? std::sqrt(variance / count) : 0.0;
}

PlaceWatch::PlaceWatch(const Intrinsics& camera, const MarkerMap& scene, const SensorPlace& place,
                       SeenCorners corners, double scatter_px, const Eigen::Vector3d& body_m)
    : camera_(camera), body_camera_(place.T_camera_scene * body_m), scatter_px_(scatter_px) {
  for (const int id : place.markers) {
    start_[id] = corners.at(id);
    for (std::size_t c = 0; c < 4; ++c)
      in_camera_[id][c] = place.T_camera_scene * scene.at(id).corners[c];
  }
  last_ = start_;
  // One marker's place is known from eight coordinates, the sensor's from those of all; what counts
  // is the body beside them, for which a few markers are worth less than their number.
  const double images = static_cast<double>(kImagesJudged);
  const double coordinates = 8.0 * static_cast<double>(start_.size());
  still_px_ = std::max(0.25 * camera.width / 640.0, kSurely * scatter_px / std::sqrt(4.0 * images));
  const double of_place_rad = 4.0 * scatter_px / camera.fx / std::sqrt(images * coordinates);
  shift_limit_m_ = std::max(kShift_m, kSurely * of_place_rad * body_camera_.z());
  turn_limit_rad_ = std::max(kTurn_rad, 2.0 * kSurely * of_place_rad);
}

std::vector<ImageCorners> PlaceWatch::Expected() const {
  std::vector<ImageCorners> expected;
  for (const auto& [id, corners] : last_) expected.push_back(corners);
  return expected;
}

Pose PlaceWatch::MotionOf(const SeenCorners& now, Doubt& doubt) const {
  // Relative to the start, so that errors of the map and of the lens cancel.
  std::vector<Sighting> sightings;
  for (const auto& [id, corners] : now) {
    for (std::size_t c = 0; c < 4; ++c) {
      const Vector3d& p = in_camera_.at(id)[c];
      sightings.push_back({id, p, Project(camera_, p) + corners[c] - start_.at(id)[c]});
    }
  }
  Pose T = Pose::Identity();
  Refine(T, sightings, camera_, 0.5 * camera_.width / 640.0);
  Matrix6d information = Matrix6d::Zero();
  for (const Sighting& s : sightings) {
    const Matrix2x6d J = PixelJacobian(camera_, s.p);
    information += J.transpose() * J;
  }
  const double of_corner_px = scatter_px_ / std::sqrt(static_cast<double>(kImagesJudged));
  const Matrix6d covariance = of_corner_px * of_corner_px * information.inverse();
  const Matrix3x6d to_body = PointJacobian(body_camera_);
  doubt = {.shift_m = std::sqrt((to_body * covariance * to_body.transpose()).trace()),
           .turn_rad = std::sqrt(covariance.topLeftCorner<3, 3>().trace())};
  return T;
}

PlaceCheck PlaceWatch::Check(
    const SeenCorners& seen,
    const std::function<std::optional<bool>(const Pose& T_now_before)>& background_still) {
  SeenCorners known;
  for (const auto& [id, corners] : seen) {
    if (!start_.contains(id)) continue;
    known[id] = corners;
    last_[id] = corners;
  }
  recent_.push_back(known);
  if (recent_.size() > kImagesJudged) recent_.erase(recent_.begin());
  PlaceCheck check{.num_seen = static_cast<int>(known.size())};
  CornerMeans means;
  for (const SeenCorners& image : recent_) means.Add(image);
  const SeenCorners now = means.Means();
  for (const auto& [id, corners] : now) {
    if ((CentreOf(corners) - CentreOf(start_.at(id))).norm() < still_px_) check.still.push_back(id);
  }
  constexpr std::size_t kLeastForPose = 3;
  if (recent_.size() < kImagesJudged || now.size() < kLeastForPose) return check;
  Doubt doubt;
  check.T_now_before = MotionOf(now, doubt);
  check.shift_m = (check.T_now_before * body_camera_ - body_camera_).norm();
  check.turn_rad = RotationAngle(check.T_now_before);
  const bool some_moved = check.still.size() < now.size();
  // Where an arm covers most of the markers, the few others say less.
  const bool all_moved = check.shift_m > std::max(shift_limit_m_, kSurely * doubt.shift_m) ||
                         check.turn_rad > std::max(turn_limit_rad_, kSurely * doubt.turn_rad);
  if (!all_moved) {
    check.couch_moved = some_moved && 2 * check.still.size() < now.size();
    return check;
  }
  // A sensor that moves takes all markers along: two that stayed where they were, against what the
  // others say, are proof enough.
  constexpr int kProof = 2;
  int proof = 0;
  for (const int id : check.still) {
    double off = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const Vector3d& p = in_camera_.at(id)[c];
      const Vector2d moved = Project(camera_, check.T_now_before * p) - Project(camera_, p);
      off += (now.at(id)[c] - start_.at(id)[c] - moved).norm() / 4;
    }
    proof += off > still_px_ ? 1 : 0;
  }
  if (proof >= kProof) {
    check.couch_moved = true;
    return check;
  }
  check.couch_moved = background_still(check.T_now_before).value_or(false);
  check.sensor_moved = !check.couch_moved;
  return check;
}

}  // namespace plumb
