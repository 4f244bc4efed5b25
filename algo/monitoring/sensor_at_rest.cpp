// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/sensor_at_rest.hpp"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/polygon.hpp"
#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/monitoring/advice.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

using Eigen::Vector3d;

constexpr int kMeshDecimation = 2;
constexpr double kMount_s = 1.0;
constexpr double kMountScatter_px = 0.5;  // at 640 columns
constexpr double kMountShift_m = 0.5 * kMillimetre;
constexpr double kOnSupport_m = 2 * kCentimetre;
constexpr double kBackground_m = 10 * kCentimetre;  // below the support
constexpr float kLargestCorrection = 0.02F;         // of a depth
constexpr double kCheckInterval_s = 0.19;           // five times a second
constexpr double kDriftTime_s = 10.0;
constexpr float kRecent = 0.2F;
constexpr std::size_t kLeastRegionBlocks = 300;

// Images without any depth, as a covered sensor gives them, do not count as equal.
bool IsSameImage(const std::vector<float>& one, const std::vector<float>& other) {
  return one == other && std::ranges::any_of(one, [](float inverse) { return inverse > 0; });
}

}  // namespace

MonitoredScene::MonitoredScene(const Scene& scene,
                               const std::vector<Eigen::Vector2d>& region_polygon_m)
    : markers(scene.markers), room_markers(scene.room_markers) {
  if (!scene.height_map) throw DataError(say::monitoring::NoHeightMap());
  constexpr std::size_t kLeastMarkers = 4;
  if (markers.size() < kLeastMarkers)
    throw DataError(say::monitoring::TooFewMarkers(markers.size()));
  grid = scene.height_map->grid;
  const Body body = FindBody(SceneCloud(scene, Eigen::Affine3d::Identity()));
  region = RegionMask(*scene.height_map, body, region_polygon_m);
  const std::optional<Vector3d> centre = RegionCentroid(*scene.height_map, region);
  if (!centre || !body.support) throw DataError(say::monitoring::NoBody());
  centroid_m = *centre;
  support = *body.support;
  mesh = MeshOfHeightMap(*scene.height_map, {}, {.decimation = kMeshDecimation});
}

SurfacePart MonitoredScene::PartOf(const Vector3d& p) const {
  const std::optional<std::size_t> cell = grid.cell(p.x(), p.y());
  if (cell && region[*cell] != 0) return SurfacePart::kRegion;
  return std::abs(support.Height(p)) < kOnSupport_m ? SurfacePart::kSupport : SurfacePart::kOther;
}

SensorAtRest::SensorAtRest(const StreamInfo& info, const MonitoredScene& scene)
    : info_(info),
      scene_(scene),
      grid_(info.intrinsics),
      detector_(MarkerDictionary::ByName(scene.room_markers.dictionary)) {
  if (info.room_markers.dictionary != scene.room_markers.dictionary)
    throw DataError(
        say::monitoring::OtherMarkers(info.room_markers.dictionary, scene.room_markers.dictionary));
}

SeenCorners SensorAtRest::Detect(const Frame& frame) const {
  cv::Mat gray;
  cv::cvtColor(frame.color_rgb, gray, cv::COLOR_RGB2GRAY);
  const MarkerDetection found = watch_ && !watch_->Expected().empty()
                                    ? detector_.DetectNear(gray, watch_->Expected())
                                    : detector_.Detect(gray);
  SeenCorners seen;
  for (const MarkerObservation& marker : found.markers) {
    if (scene_.markers.contains(marker.id)) seen[marker.id] = marker.corners;
  }
  return seen;
}

void SensorAtRest::Mount(const Frame& frame) {
  if (!mounting_since_s_) mounting_since_s_ = frame.depth_time_s;
  const SeenCorners seen = Detect(frame);
  const double age_s = frame.depth_time_s - *mounting_since_s_;
  (age_s < 0.5 * kMount_s ? first_half_ : second_half_).Add(seen);
  corners_.Add(seen);
  if (age_s < kMount_s) return;
  const auto place = PlaceByMarkers(corners_.Means(), scene_.markers, info_.intrinsics);
  const auto early = PlaceByMarkers(first_half_.Means(), scene_.markers, info_.intrinsics);
  const auto late = PlaceByMarkers(second_half_.Means(), scene_.markers, info_.intrinsics);
  const double scatter_px = corners_.Scatter_px();
  const bool still =
      place && early && late && scatter_px < kMountScatter_px * info_.intrinsics.width / 640.0 &&
      (early->T_camera_scene * scene_.centroid_m - late->T_camera_scene * scene_.centroid_m)
              .norm() < std::max(kMountShift_m, scatter_px / info_.intrinsics.fx);
  if (still) {
    place_ = *place;
    watch_.emplace(info_.intrinsics, scene_.markers, place_, corners_.Means(), scatter_px,
                   scene_.centroid_m);
    stage_ = RestStage::kZeroing;
  }
  // Otherwise the next second is as good as this one.
  first_half_ = second_half_ = corners_ = {};
  mounting_since_s_.reset();
}

void SensorAtRest::AddStill(const Frame& frame) {
  BlockImage image = AverageBlocks(frame.depth_m, grid_, info_.usable_depth);
  still_.time_s.push_back(frame.depth_time_s);
  still_.inverse_depth.push_back(std::move(image.inverse_depth));
}

FitView SensorAtRest::ViewOf(const BlockImage& image, const Eigen::Vector2d& modes_m) const {
  FitView view{.grid = grid_,
               .model = model_,
               .image = image,
               .T_scene_camera = place_.T_camera_scene.inverse(),
               .correction = correction_.empty() ? nullptr : &correction_,
               .drift = drift_,
               .modes_of_model_m = zero_modes_m_,
               .modes_m = modes_m};
  if (!breathing_) return view;
  view.modes[0] = &breathing_->rise;
  if (breathing_->lag.empty()) return view;
  view.modes[1] = &breathing_->lag;
  view.mode_sigmas_m[1] = 2.0 * breathing_->lag_sigma_m;
  return view;
}

bool SensorAtRest::RepeatedAtZero() const {
  std::size_t first = 0;  // The first of a run of equal images.
  for (std::size_t i = 1; i < still_.size(); ++i) {
    if (IsSameImage(still_.inverse_depth[i], still_.inverse_depth[i - 1])) continue;
    if (still_.time_s[i - 1] - still_.time_s[first] > kLongestGap_s) return true;
    first = i;
  }
  return false;
}

BlockImage SensorAtRest::StillImage(std::size_t frame) const {
  return {.inverse_depth = still_.inverse_depth[frame], .ray = grid_.centre_ray};
}

FitView SensorAtRest::StillView(const BlockImage& image, std::size_t frame) const {
  return ViewOf(image, breathing_ ? breathing_->sizes_m[frame] : Eigen::Vector2d::Zero());
}

bool SensorAtRest::Zero(ZeroKind kind) {
  // Nothing is left of an earlier try.
  correction_.clear();
  breathing_.reset();
  zero_modes_m_.setZero();
  faces_.clear();
  const Pose T_scene_camera = place_.T_camera_scene.inverse();
  const auto render = [&](const Pose& T_motion) {
    const Pose T_back = T_motion.inverse();
    model_ = MakeViewModel(
        AverageBlocks(RenderDepth(scene_.mesh, place_.T_camera_scene * T_motion, info_.intrinsics),
                      grid_, info_.usable_depth),
        grid_, T_scene_camera, info_.depth_noise,
        [&](const Vector3d& p) { return scene_.PartOf(T_back * p); });
  };
  const auto fit_to = [&](const std::vector<float>& inverse_depth) {
    const BlockImage mean{.inverse_depth = inverse_depth, .ray = grid_.centre_ray};
    const FitView view = ViewOf(mean, Eigen::Vector2d::Zero());
    return FitMotion({&view, 1}, scene_.centroid_m, {});
  };
  render(Pose::Identity());
  if (still_.size() == 0 || model_.CountOf(SurfacePart::kRegion) < kLeastRegionBlocks) return false;
  const MotionFit first = fit_to(MeanOf(still_, {0, still_.size()}));
  constexpr double kLeastVisibleAtFirst = 0.5;
  if (!first.converged || first.visible() < kLeastVisibleAtFirst) return false;
  render(first.T);
  std::optional<BreathingMode> mode =
      LearnBreathing(still_, model_, grid_, T_scene_camera, scene_.support.normal);
  if (kind == ZeroKind::kOfWholeBreath && !(mode && mode->is_whole)) return false;
  const std::pair<std::size_t, std::size_t> zero_frames =
      mode ? mode->last_breath : std::pair<std::size_t, std::size_t>{0, still_.size()};
  const std::vector<float> zero = MeanOf(still_, zero_frames);
  frames_in_zero_ = zero_frames.second - zero_frames.first;
  // The mean height during that breath belongs to the model.
  zero_modes_m_.setZero();
  for (std::size_t k = zero_frames.first; mode && k < zero_frames.second; ++k)
    zero_modes_m_ += mode->sizes_m[k] / static_cast<double>(frames_in_zero_);
  // The mean itself is a surface at rest: it is fitted without the mode.
  since_scan_ = fit_to(zero);
  since_scan_.T = since_scan_.T * first.T;
  render(since_scan_.T);
  breathing_ = std::move(mode);
  SetCorrection(zero);
  FindFaces();
  is_without_noise_ = RepeatedAtZero();
  stage_ = RestStage::kReady;
  return model_.CountOf(SurfacePart::kRegion) >= kLeastRegionBlocks;
}

void SensorAtRest::DropOutlines(const std::vector<float>& zero) {
  constexpr float kFarOff = 3.5F;  // standard deviations of all
  std::vector<float> ratios, off;
  for (std::size_t b = 0; b < grid_.size(); ++b) {
    if (model_.part[b] == SurfacePart::kRegion && zero[b] > 0)
      ratios.push_back(model_.inverse_depth[b] / zero[b]);
  }
  if (ratios.empty()) return;
  std::vector<float> sorted = ratios;
  const float middle = TakeMedian(sorted);
  for (const float ratio : ratios) off.push_back(std::abs(ratio - middle));
  const float limit = kFarOff * 1.4826F * TakeMedian(off);
  for (std::size_t b = 0; b < grid_.size(); ++b) {
    if (model_.part[b] == SurfacePart::kRegion && zero[b] > 0 &&
        std::abs(model_.inverse_depth[b] / zero[b] - middle) > limit)
      model_.part[b] = SurfacePart::kNone;
  }
}

void SensorAtRest::SetCorrection(const std::vector<float>& zero) {
  zero_inverse_depth_ = zero;
  recent_ = zero;
  background_ = MakeViewModel({.inverse_depth = zero, .ray = grid_.centre_ray}, grid_,
                              place_.T_camera_scene.inverse(), info_.depth_noise,
                              [&](const Vector3d& p) { return scene_.PartOf(p); });
  correction_.assign(grid_.size(), 0.0F);
  DropOutlines(zero);
  double squares = 0, sum_m = 0, squares_m = 0;
  std::size_t count = 0;
  for (std::size_t b = 0; b < grid_.size(); ++b) {
    if (model_.part[b] != SurfacePart::kRegion) continue;
    const float ratio = zero[b] > 0 ? model_.inverse_depth[b] / zero[b] : 0.0F;
    if (!(std::abs(ratio - 1.0F) < kLargestCorrection)) {
      model_.part[b] = SurfacePart::kNone;
      continue;
    }
    correction_[b] = ratio;
    const double off_m = (ratio - 1.0F) / model_.inverse_depth[b];
    const double in_sigmas = off_m / model_.sigma_m[b];
    squares += in_sigmas * in_sigmas;
    sum_m += off_m;
    squares_m += off_m * off_m;
    ++count;
  }
  const double all = std::max(1.0, static_cast<double>(count));
  static_error_ = std::sqrt(squares / all);
  static_error_m_ = std::sqrt(std::max(0.0, squares_m / all - sum_m * sum_m / (all * all)));
  // Where the body may move to, the sensor's error is taken to be that of the nearest blocks;
  // farther away nothing is taken to be the body.
  constexpr int kReach = 12;
  for (int step = 0; step < kReach; ++step) {
    std::vector<float> grown = correction_;
    for (std::size_t b = 0; b < grid_.size(); ++b) {
      if (correction_[b] > 0) continue;
      const int row = static_cast<int>(b) / grid_.columns,
                column = static_cast<int>(b) % grid_.columns;
      float sum = 0;
      int neighbours = 0;
      for (int r = std::max(0, row - 1); r <= std::min(grid_.rows - 1, row + 1); ++r) {
        for (int c = std::max(0, column - 1); c <= std::min(grid_.columns - 1, column + 1); ++c) {
          const float value = correction_[static_cast<std::size_t>(r * grid_.columns + c)];
          if (value <= 0) continue;
          sum += value;
          ++neighbours;
        }
      }
      if (neighbours > 0) grown[b] = sum / static_cast<float>(neighbours);
    }
    correction_ = std::move(grown);
  }
}

void SensorAtRest::FindFaces() {
  constexpr double kBoard = 1.2;  // the white around the print is flat, too
  const double middle = 0.5 * (grid_.side - 1);
  for (const auto& [id, corners] : watch_->at_start()) {
    const Eigen::Vector2d centre = CentreOf(corners);
    for (std::size_t b = 0; b < grid_.size(); ++b) {
      if (zero_inverse_depth_[b] <= 0 || model_.part[b] == SurfacePart::kRegion) continue;
      const Eigen::Vector2d pixel(
          static_cast<double>(static_cast<int>(b) % grid_.columns) * grid_.side + middle,
          static_cast<double>(static_cast<int>(b) / grid_.columns) * grid_.side + middle);
      const Eigen::Vector2d scaled = centre + (pixel - centre) / kBoard;
      if (InsidePolygon(corners, scaled.x(), scaled.y())) faces_.push_back({id, b});
    }
  }
}

SeenImage SensorAtRest::See(const Frame& frame) {
  BlockImage image = AverageBlocks(frame.depth_m, grid_, info_.usable_depth);
  if (!is_without_noise_ && IsSameImage(image.inverse_depth, image_.inverse_depth))
    return SeenImage::kRepeated;
  image_ = std::move(image);
  for (std::size_t b = 0; b < recent_.size(); ++b) {
    const float now = image_.inverse_depth[b];
    if (now <= 0) continue;
    recent_[b] = recent_[b] > 0 ? recent_[b] + kRecent * (now - recent_[b]) : now;
  }
  const bool is_due = !check_time_s_ || frame.depth_time_s - *check_time_s_ >= kCheckInterval_s;
  if (is_due) {
    check_time_s_ = frame.depth_time_s;
    CheckPlace(frame);
  }
  FollowDrift(frame.depth_time_s);
  MeasureSupport();
  return is_due ? SeenImage::kChecked : SeenImage::kTaken;
}

void SensorAtRest::ForgetPlace() {
  std::ranges::fill(recent_, 0.0F);
  watch_->Forget();
  check_time_s_.reset();
}

void SensorAtRest::CheckPlace(const Frame& frame) {
  check_ = watch_->Check(
      Detect(frame), [this](const Pose& T_now_before) { return IsBackgroundStill(T_now_before); });
}

std::optional<bool> SensorAtRest::IsBackgroundStill(const Pose& T_now_before) const {
  constexpr int kLeastBlocks = 150;
  const Pose T_before_now = T_now_before.inverse();
  const Pose T_scene_camera = place_.T_camera_scene.inverse();
  double product = 0, squares = 0;
  int count = 0;
  for (std::size_t b = 0; b < grid_.size(); ++b) {
    if (background_.part[b] != SurfacePart::kOther || recent_[b] <= 0) continue;
    const Vector3d p = background_.point[b].cast<double>();
    if (scene_.support.Height(p) > -kBackground_m) continue;
    const double z = 1.0 / (static_cast<double>(recent_[b]) * drift_);
    const Vector3d q(grid_.centre_ray[b].x() * z, grid_.centre_ray[b].y() * z, z);
    const Vector3d n = background_.normal[b].cast<double>();
    const double if_still = n.dot(T_scene_camera * q - p);
    const double if_moved = n.dot(T_scene_camera * (T_before_now * q) - p);
    const double change = if_still - if_moved;
    constexpr double kOutlier_m = 3 * kCentimetre;
    if (std::abs(if_still) > kOutlier_m) continue;
    product += change * if_still;
    squares += change * change;
    ++count;
  }
  if (count < kLeastBlocks || !(squares > 0)) return std::nullopt;
  return product / squares < 0.5;
}

void SensorAtRest::FollowDrift(double time_s) {
  constexpr std::size_t kLeastBlocks = 30;
  constexpr float kCovered = 0.02F;  // something else is before it
  std::vector<float> ratios;
  for (const FaceBlock& face : faces_) {
    if (!std::binary_search(check_.still.begin(), check_.still.end(), face.marker)) continue;
    const float now = image_.inverse_depth[face.block];
    if (now <= 0) continue;
    const float ratio = zero_inverse_depth_[face.block] / now;
    if (std::abs(ratio - 1.0F) < kCovered) ratios.push_back(ratio);
  }
  const double dt_s = drift_time_s_ ? std::max(0.0, time_s - *drift_time_s_) : 0.0;
  drift_time_s_ = time_s;
  if (ratios.size() < kLeastBlocks) return;
  const double now = TakeMedian(ratios);
  drift_ += (now - drift_) * std::min(1.0, dt_s / kDriftTime_s);
}

void SensorAtRest::MeasureSupport() {
  constexpr std::size_t kLeastBlocks = 100;
  constexpr float kFar_m = 0.05F;
  std::vector<float> rises;
  const Eigen::Matrix3f R_scene_camera = place_.T_camera_scene.linear().transpose().cast<float>();
  for (std::size_t b = 0; b < grid_.size(); ++b) {
    if (background_.part[b] != SurfacePart::kSupport || image_.inverse_depth[b] <= 0) continue;
    const float nearer = 1.0F / zero_inverse_depth_[b] -
                         1.0F / (image_.inverse_depth[b] * static_cast<float>(drift_));
    if (std::abs(nearer) > kFar_m) continue;
    const Eigen::Vector3f ray(grid_.centre_ray[b].x(), grid_.centre_ray[b].y(), 1.0F);
    rises.push_back(-nearer * background_.normal[b].dot(R_scene_camera * ray));
  }
  support_rise_m_.reset();
  if (rises.size() >= kLeastBlocks) support_rise_m_ = TakeMedian(rises);
}

}  // namespace plumb
