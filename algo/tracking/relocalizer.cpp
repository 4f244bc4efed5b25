// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/relocalizer.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>

#include "algo/geometry/rigid_fit.hpp"
#include "algo/markers/camera_pose.hpp"
#include "algo/tracking/view_geometry.hpp"

namespace plumb {
namespace {

// Measured with a sensor that was covered half-way, all numbers from here to kAgreeingDepth laxer
// at once, then stricter, each by about a factor of two: a sweep of sim-a 21.9 and 5.6 mm instead
// of 13.7 mm, the real Kinect without markers 9.3 and 8.7 instead of 7.6 mm, 54 and 55 of its
// images instead of 54 tracked. Of 8 markers of a sweep seen first, one reprojection error
// was 1.3 to 33 times the other, and 0.3 px at most the smaller.

// A square seen from afar has two poses. The image decides by the ratio of the two reprojection
// errors, both with a floor of what corners scatter by; else depth does by the ratio of the two
// distances of the marker's plane from it. Poses that differ little need no decision.
constexpr double kImageRatio = 3.0;
constexpr double kCornerScatter_px = 0.2;
constexpr double kDepthRatio = 1.5;
constexpr double kSamePose_rad = 0.15;
constexpr double kMaxMarkerError = 0.01;  // Of either pose, in units of the focal length.
// Samples of depth on a marker, of 81, without which depth does not decide.
constexpr int kLeastOnMarker = 20;

// Largest reprojection error of several known markers together: the map's and the lens's errors.
constexpr double kMaxMarkersError_px = 8.0;

constexpr double kMetresPerRadian = 0.5;  // Between two cameras: the depth of a usual scene.

// Descriptors that match: bits of 256 in which they differ, and that distance's ratio to the second
// best.
constexpr float kMaxHamming = 60;
constexpr float kMaxRatio = 0.85F;
// Matches, and among them features that agree with one pose, below which a place is not recognised.
constexpr int kLeastAgreeing = 15;
// A feature agrees within these, in the image and as a fraction of its depth.
constexpr double kAgreeing_px = 4.0;
constexpr double kAgreeingDepth = 0.03;
// Of three matches each: with a third of the matches correct, at least one round in 27 draws three
// correct ones, so that 150 miss with a probability of 0.4 %.
constexpr int kConsensusRounds = 150;

double ReprojectionRms(const Pose& T_camera_points, const std::vector<cv::Point3d>& points,
                       const std::vector<cv::Point2d>& ideal) {
  double sum = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p =
        T_camera_points * Eigen::Vector3d(points[i].x, points[i].y, points[i].z);
    if (p.z() <= 0) return 1e9;
    sum += (p.head<2>() / p.z() - Eigen::Vector2d(ideal[i].x, ideal[i].y)).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

// Mean distance between a marker's plane and the depth measured on it; nothing with too little
// depth.
std::optional<double> DepthMisfit(const Intrinsics& intrinsics, const Pose& T_camera_marker,
                                  double length_m, const cv::Mat& depth_m) {
  double sum = 0;
  int n = 0;
  for (int i = -4; i <= 4; ++i) {
    for (int j = -4; j <= 4; ++j) {
      const Eigen::Vector3d p =
          T_camera_marker * Eigen::Vector3d(i * length_m / 10, j * length_m / 10, 0);
      if (p.z() <= 0) continue;
      const double z = DepthAt(depth_m, Project(intrinsics, p));
      if (z <= 0) continue;
      sum += std::abs(z - p.z());
      ++n;
    }
  }
  if (n < kLeastOnMarker) return std::nullopt;
  return sum / n;
}

double Distance(const Pose& T_a, const Pose& T_b) {
  const Pose T_a_b = T_a.inverse() * T_b;
  return T_a_b.translation().norm() + kMetresPerRadian * RotationAngle(T_a_b);
}

}  // namespace

std::optional<Pose> MarkerPoseInCamera(const Intrinsics& intrinsics, double marker_length_m,
                                       const MarkerObservation& marker, const cv::Mat& depth_m) {
  std::vector<cv::Point3d> corners;
  std::vector<cv::Point2d> ideal;
  for (const Eigen::Vector3d& c : CornersInMarkerFrame(marker_length_m))
    corners.emplace_back(c.x(), c.y(), c.z());
  for (const Eigen::Vector2d& pixel : marker.corners) {
    const Eigen::Vector2d u = Undistort(intrinsics, pixel);
    ideal.emplace_back(u.x(), u.y());
  }
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::solvePnPGeneric(corners, ideal, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations,
                      translations, false, cv::SOLVEPNP_IPPE_SQUARE);
  std::array<double, 2> error{1e9, 1e9};
  std::array<Pose, 2> candidates;
  const std::size_t n = std::min<std::size_t>(2, rotations.size());
  for (std::size_t i = 0; i < n; ++i) {
    candidates[i] = PoseFromCv(rotations[i], translations[i]);
    error[i] = ReprojectionRms(candidates[i], corners, ideal);
  }
  if (n == 0 || std::min(error[0], error[1]) > kMaxMarkerError) return std::nullopt;
  if (n == 1) return candidates[0];
  const auto misfit0 = DepthMisfit(intrinsics, candidates[0], marker_length_m, depth_m);
  const auto misfit1 = DepthMisfit(intrinsics, candidates[1], marker_length_m, depth_m);
  const double floor = kCornerScatter_px / intrinsics.fx;
  if ((error[1] + floor) > kImageRatio * (error[0] + floor)) return candidates[0];
  if ((error[0] + floor) > kImageRatio * (error[1] + floor)) return candidates[1];
  if (misfit0 && misfit1 &&
      std::max(*misfit0, *misfit1) > kDepthRatio * std::min(*misfit0, *misfit1))
    return *misfit0 < *misfit1 ? candidates[0] : candidates[1];
  if (RotationAngle(candidates[0].inverse() * candidates[1]) < kSamePose_rad)
    return error[0] <= error[1] ? candidates[0] : candidates[1];
  return std::nullopt;
}

int NearestKeyframe(const TrackingMap& map, const Pose& T_world_color) {
  int best = 0;
  double best_distance = 1e300;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    if (map.keyframes[k].is_bare) continue;  // It has no images to track against.
    const double d = Distance(map.keyframes[k].T_world_color, T_world_color);
    if (d < best_distance) {
      best_distance = d;
      best = static_cast<int>(k);
    }
  }
  return best;
}

std::optional<Relocalization> RelocalizeByMarkers(const TrackingMap& map,
                                                  const Intrinsics& intrinsics,
                                                  double marker_length_m,
                                                  const std::vector<MarkerObservation>& markers,
                                                  const cv::Mat& depth_m) {
  std::vector<const MarkerObservation*> known;
  for (const MarkerObservation& m : markers)
    if (map.markers.contains(m.id)) known.push_back(&m);
  if (known.empty()) return std::nullopt;
  std::vector<cv::Point3d> corners;
  std::vector<cv::Point2d> ideal;
  for (const MarkerObservation* m : known) {
    const MarkerCorners in_marker = CornersInMarkerFrame(marker_length_m);
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector3d p = map.markers.at(m->id).T_world_marker * in_marker[i];
      const Eigen::Vector2d u = Undistort(intrinsics, m->corners[i]);
      corners.emplace_back(p.x(), p.y(), p.z());
      ideal.emplace_back(u.x(), u.y());
    }
  }
  Relocalization result;
  if (known.size() == 1) {
    const auto T_camera_marker =
        MarkerPoseInCamera(intrinsics, marker_length_m, *known[0], depth_m);
    if (!T_camera_marker) return std::nullopt;
    result.T_world_color = map.markers.at(known[0]->id).T_world_marker * T_camera_marker->inverse();
  } else {
    const std::optional<Pose> T_camera_world = PoseFromPoints(corners, ideal);
    if (!T_camera_world ||
        ReprojectionRms(*T_camera_world, corners, ideal) > kMaxMarkersError_px / intrinsics.fx)
      return std::nullopt;
    result.T_world_color = T_camera_world->inverse();
  }
  result.num_inliers = static_cast<int>(corners.size());
  result.keyframe = NearestKeyframe(map, result.T_world_color);
  return result;
}

namespace {

// Consensus of three-point rigid fits between a keyframe's features and the frame's.
std::optional<Relocalization> Consensus(const MapKeyframe& keyframe, const Intrinsics& intrinsics,
                                        const DescribedFeatures& features,
                                        const std::vector<cv::DMatch>& matches) {
  std::mt19937 random(1);
  const auto draw = [&] { return static_cast<std::size_t>(random() % matches.size()); };
  const auto agrees = [&](const Pose& T_frame_keyframe, const cv::DMatch& m) {
    const Eigen::Vector3d p =
        T_frame_keyframe *
        keyframe.features_camera[static_cast<std::size_t>(m.trainIdx)].cast<double>();
    if (p.z() < kNearestInView_m) return false;
    const Eigen::Vector3d q =
        features.in_camera[static_cast<std::size_t>(m.queryIdx)].cast<double>();
    const double pixels = (p.head<2>() / p.z() - q.head<2>() / q.z()).norm() * intrinsics.fx;
    return pixels < kAgreeing_px * intrinsics.width / 640.0 &&
           std::abs(p.z() - q.z()) < kAgreeingDepth * q.z();
  };
  const auto fit = [&](const std::vector<cv::DMatch>& pairs) {
    std::vector<Eigen::Vector3d> in_frame;
    std::vector<Eigen::Vector3d> in_keyframe;
    for (const cv::DMatch& m : pairs) {
      in_frame.push_back(features.in_camera[static_cast<std::size_t>(m.queryIdx)].cast<double>());
      in_keyframe.push_back(
          keyframe.features_camera[static_cast<std::size_t>(m.trainIdx)].cast<double>());
    }
    return FitRigid(in_frame, in_keyframe);
  };
  std::vector<cv::DMatch> best;
  for (int round = 0; round < kConsensusRounds; ++round) {
    const RigidFit candidate = fit({matches[draw()], matches[draw()], matches[draw()]});
    if (!candidate.valid) continue;
    std::vector<cv::DMatch> inliers;
    for (const cv::DMatch& m : matches)
      if (agrees(candidate.T_a_b, m)) inliers.push_back(m);
    if (inliers.size() > best.size()) best = std::move(inliers);
  }
  if (best.size() < kLeastAgreeing) return std::nullopt;
  const RigidFit refined = fit(best);
  if (!refined.valid) return std::nullopt;
  Relocalization result;
  result.T_world_color = keyframe.T_world_color * refined.T_a_b.inverse();
  result.num_inliers = static_cast<int>(best.size());
  return result;
}

}  // namespace

std::optional<Relocalization> RelocalizeByFeatures(const TrackingMap& map,
                                                   const Intrinsics& intrinsics,
                                                   const DescribedFeatures& features,
                                                   const std::vector<int>& keyframes) {
  std::optional<Relocalization> best;
  if (features.descriptors.rows < kLeastAgreeing) return best;
  const cv::BFMatcher matcher(cv::NORM_HAMMING);
  for (const int k : keyframes) {
    const MapKeyframe& keyframe = map.keyframe(k);
    if (keyframe.descriptors.rows < kLeastAgreeing) continue;
    std::vector<std::vector<cv::DMatch>> pairs;
    matcher.knnMatch(features.descriptors, keyframe.descriptors, pairs, 2);
    std::vector<cv::DMatch> matches;
    for (const auto& pair : pairs)
      if (pair.size() == 2 && pair[0].distance < kMaxHamming &&
          pair[0].distance < kMaxRatio * pair[1].distance)
        matches.push_back(pair[0]);
    if (matches.size() < kLeastAgreeing) continue;
    auto candidate = Consensus(keyframe, intrinsics, features, matches);
    if (!candidate || (best && candidate->num_inliers <= best->num_inliers)) continue;
    candidate->keyframe = k;
    best = candidate;
    if (best->num_inliers >= kBeyondDoubt) break;
  }
  return best;
}

}  // namespace plumb
