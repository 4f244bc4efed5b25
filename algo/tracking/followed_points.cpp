// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/followed_points.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "algo/tracking/view_geometry.hpp"

namespace plumb {
namespace {

constexpr std::size_t kKeptPyramids = 6;  // Pyramids of keyframes, 2.3 MB each.
// Relative change of exposure that KLT tolerates without correction.
constexpr double kSameBrightness = 0.08;

// Standard deviations in pixels of a point followed from the last image, and of one found again
// from an older keyframe's patch, which was seen from elsewhere.
constexpr double kSigmaFollowed_px = 1.2;
constexpr double kSigmaFoundAgain_px = 2.0;
// A keypoint's depth is less certain than a surface's: it is often a corner of the surface, too.
constexpr double kDepthNoiseFactor = 2.0;
constexpr double kUsualCosine = 0.8;  // Of the incidence; the surface's own is not known here.
constexpr double kDepthError_m = 0.003;
// Difference of a landmark's depth from the image's above which it is hidden, or another surface.
constexpr double kHidden_m = 0.01;
constexpr double kHiddenPart = 0.03;     // Of the depth.
constexpr int kBorder_px = 8;            // Patches nearer to the border are incomplete.
constexpr double kSearch_px = 6.0;       // Farthest that a landmark is found from its projection.
constexpr double kObserved_px = 4.0;     // Once the pose is known.
constexpr int kReassociationLevels = 1;  // Of the pyramid: the projection is a good start.

}  // namespace

void FollowedPoints::Follow(const Pyramid& last, const GrayImage& image, const cv::Mat& depth_m,
                            const Pose& T_world_guess, std::vector<ActivePoint>& followed,
                            std::vector<PosePoint>& points) const {
  std::vector<Eigen::Vector2f> from;
  std::vector<Eigen::Vector2f> guesses;
  const Pose T_camera_world = T_world_guess.inverse();
  for (const ActivePoint& a : active_) {
    from.push_back(a.pixel);
    const Eigen::Vector3d p = T_camera_world * map_.landmark(a.landmark).p_world;
    guesses.push_back(p.z() > kNearestInView_m
                          ? Eigen::Vector2f(Project(intrinsics_, p).cast<float>())
                          : a.pixel);
  }
  const KltResult klt = FollowAtAnyBrightness(last, image, from, guesses, options_.levels);
  for (std::size_t i = 0; i < active_.size(); ++i) {
    if (!klt.found[i]) continue;
    PosePoint point;
    point.p_world = map_.landmark(active_[i].landmark).p_world;
    const Eigen::Vector2d pixel = klt.points[i].cast<double>();
    point.ideal = Undistort(intrinsics_, pixel);
    point.sigma = kSigmaFollowed_px * SigmaPx() / intrinsics_.fx;
    if (const double z = DepthAt(depth_m, pixel); z > 0) {
      point.inverse_z = 1.0 / z;
      const double sigma_m =
          kDepthNoiseFactor * DepthSigma(depth_noise_, z, kUsualCosine) + kDepthError_m;
      point.inverse_z_sigma = sigma_m / (z * z);
    }
    points.push_back(point);
    followed.push_back({active_[i].landmark, klt.points[i]});
  }
}

// KLT. If it loses most points, it is repeated at the new image's brightness, because the exposure
// may have changed.
KltResult FollowedPoints::FollowAtAnyBrightness(const Pyramid& before, const GrayImage& image,
                                                const std::vector<Eigen::Vector2f>& from,
                                                const std::vector<Eigen::Vector2f>& guesses,
                                                int max_level) const {
  const auto num_found = [](const KltResult& klt) {
    return std::count(klt.found.begin(), klt.found.end(), true);
  };
  KltResult klt = TrackKlt(before, image.pyramid, from, guesses, max_level, options_);
  if (2 * num_found(klt) >= static_cast<std::ptrdiff_t>(from.size())) return klt;
  const double ratio = BrightnessRatio(before[0], image.gray, from, guesses);
  if (std::abs(ratio - 1.0) < kSameBrightness) return klt;
  KltResult again = TrackKlt(MakePyramid(before[0] * ratio, options_), image.pyramid, from, guesses,
                             max_level, options_);
  return num_found(again) > num_found(klt) ? again : klt;
}

void FollowedPoints::Reassociate(const GrayImage& image, const cv::Mat& depth_m,
                                 const Pose& T_world_color,
                                 const std::vector<std::size_t>& keyframes,
                                 std::vector<PosePoint>& points) {
  std::set<int> followed;
  for (const ActivePoint& a : active_) followed.insert(a.landmark);
  const Pose T_camera_world = T_world_color.inverse();
  for (const std::size_t k : keyframes) {
    const MapKeyframe& keyframe = map_.keyframes[k];
    std::vector<int> landmarks;
    std::vector<Eigen::Vector2f> from;
    std::vector<Eigen::Vector2f> guesses;
    for (const KeypointObservation& o : keyframe.keypoints) {
      const Landmark& landmark = map_.landmark(o.landmark);
      if (!landmark.usable || followed.contains(o.landmark)) continue;
      const Eigen::Vector3d p = T_camera_world * landmark.p_world;
      if (p.z() < kNearestInView_m) continue;
      const Eigen::Vector2d pixel = Project(intrinsics_, p);
      if (pixel.x() < kBorder_px || pixel.y() < kBorder_px ||
          pixel.x() > intrinsics_.width - 1 - kBorder_px ||
          pixel.y() > intrinsics_.height - 1 - kBorder_px)
        continue;
      const double z = DepthAt(depth_m, pixel);
      if (z > 0 && std::abs(z - p.z()) > kHiddenPart * z + kHidden_m) continue;
      landmarks.push_back(o.landmark);
      from.push_back(o.pixel.cast<float>());
      guesses.push_back(pixel.cast<float>());
    }
    if (landmarks.empty()) continue;
    const KltResult klt =
        FollowAtAnyBrightness(PyramidOfKeyframe(k), image, from, guesses, kReassociationLevels);
    for (std::size_t i = 0; i < landmarks.size(); ++i) {
      if (!klt.found[i] ||
          (klt.points[i] - guesses[i]).norm() > static_cast<float>(kSearch_px * SigmaPx()))
        continue;
      followed.insert(landmarks[i]);
      active_.push_back({landmarks[i], klt.points[i]});
      PosePoint point;
      point.p_world = map_.landmark(landmarks[i]).p_world;
      point.ideal = Undistort(intrinsics_, klt.points[i].cast<double>());
      point.sigma = kSigmaFoundAgain_px * SigmaPx() / intrinsics_.fx;
      points.push_back(point);
    }
  }
}

void FollowedPoints::KeepPyramid(std::size_t keyframe, const Pyramid& pyramid) {
  pyramids_.emplace_front(keyframe, pyramid);
  if (pyramids_.size() > kKeptPyramids) pyramids_.pop_back();
}

Pyramid FollowedPoints::PyramidOfKeyframe(std::size_t keyframe) {
  const auto kept = std::find_if(pyramids_.begin(), pyramids_.end(),
                                 [&](const auto& one) { return one.first == keyframe; });
  if (kept != pyramids_.end()) {
    std::rotate(pyramids_.begin(), kept, kept + 1);
  } else {
    KeepPyramid(keyframe, MakePyramid(map_.keyframes[keyframe].gray, options_));
  }
  return pyramids_.front().second;
}

void FollowedPoints::AddObservation(const ActivePoint& point, MapKeyframe& keyframe) {
  const Eigen::Vector2d pixel = point.pixel.cast<double>();
  const auto [z_m, slope] = SurfaceDepthAt(keyframe.data.view.depth_m, pixel);
  keyframe.keypoints.push_back({point.landmark, pixel, z_m, slope});
  ++map_.landmark(point.landmark).num_observations;
}

void FollowedPoints::Observe(const std::vector<PosePoint>& found, std::size_t first,
                             MapKeyframe& keyframe) {
  std::vector<ActivePoint> kept(active_.begin(),
                                active_.begin() + static_cast<std::ptrdiff_t>(first));
  const Pose T_camera_world = keyframe.T_world_color.inverse();
  for (std::size_t i = first; i < active_.size(); ++i) {
    const PosePoint& point = found[i - first];
    const Eigen::Vector3d p = T_camera_world * point.p_world;
    if ((p.head<2>() / p.z() - point.ideal).norm() * intrinsics_.fx >= kObserved_px * SigmaPx())
      continue;
    kept.push_back(active_[i]);
    AddObservation(active_[i], keyframe);
  }
  active_ = std::move(kept);
}

void FollowedPoints::KeepOnePerCell() {
  std::vector<Eigen::Vector2f> pixels;
  for (const ActivePoint& a : active_) pixels.push_back(a.pixel);
  std::vector<ActivePoint> kept;
  for (const std::size_t i :
       FirstOfCells(pixels, intrinsics_.width, intrinsics_.height, fewer_options_))
    kept.push_back(active_[i]);
  active_ = std::move(kept);
}

void FollowedPoints::AddCorners(const GrayImage& image, const cv::Mat& depth_m, int index,
                                bool fewer, MapKeyframe& keyframe) {
  std::vector<Eigen::Vector2f> occupied;
  for (const ActivePoint& a : active_) occupied.push_back(a.pixel);
  const Pose T_color_depth = PoseFromTwist(
      keyframe.velocity_per_s * (keyframe.data.depth_time_s - keyframe.data.color_time_s));
  for (const Eigen::Vector2f& corner :
       DetectCorners(image.gray, occupied, fewer ? fewer_options_ : options_)) {
    const Eigen::Vector2d pixel = corner.cast<double>();
    const double z = DepthAt(depth_m, pixel);
    if (z <= 0) continue;
    const Eigen::Vector3d p = z * Undistort(intrinsics_, pixel).homogeneous();
    Landmark landmark;
    landmark.p_world =
        keyframe.T_world_color * Eigen::Vector3d(p.x(), p.y(), (T_color_depth * p).z());
    landmark.first_keyframe = index;
    landmark.num_observations = 1;
    const int id = static_cast<int>(map_.landmarks.size());
    map_.landmarks.push_back(landmark);
    const auto [z_m, slope] = SurfaceDepthAt(depth_m, pixel);
    keyframe.keypoints.push_back({id, pixel, z_m, slope});
    active_.push_back({id, corner});
  }
}

}  // namespace plumb
