// SPDX-License-Identifier: Apache-2.0
#include "tests/support/rest_frames.hpp"

#include <cmath>
#include <numbers>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "algo/base/units.hpp"
#include "algo/monitoring/view_model.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "tests/support/synthetic_scene.hpp"

namespace plumb::test {
namespace {

const Eigen::Vector3d kPlace(0.6, 0.45, 0.0);
constexpr double kOnSupport_m = 0.02;

Intrinsics Camera() {
  Intrinsics camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 575.0;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

// The print with its white margin, 8 pixels a cell.
cv::Mat PrintOf(const MarkerDictionary& dictionary, int id) {
  constexpr int kCell = 8;
  const int cells = dictionary.bits_per_side() + 2;
  cv::Mat print(cells * kCell, cells * kCell, CV_8UC1, cv::Scalar(20));
  for (int row = 0; row < dictionary.bits_per_side(); ++row) {
    for (int column = 0; column < dictionary.bits_per_side(); ++column) {
      if (dictionary.Bit(id, row, column))
        print(cv::Rect((column + 1) * kCell, (row + 1) * kCell, kCell, kCell)).setTo(235);
    }
  }
  return print;
}

cv::Mat Photograph(const Scene& scene, const Pose& T_camera_scene) {
  const Intrinsics camera = Camera();
  cv::Mat gray(camera.height, camera.width, CV_8UC1, cv::Scalar(140));
  const MarkerDictionary dictionary = MarkerDictionary::ByName(scene.room_markers.dictionary);
  for (const auto& [id, marker] : scene.markers) {
    constexpr double kBoard = 1.25;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& corner : marker.corners) middle += corner / 4.0;
    std::vector<cv::Point2f> seen;
    std::vector<cv::Point> board;
    for (const Eigen::Vector3d& corner : marker.corners) {
      const Eigen::Vector2d pixel = Project(camera, T_camera_scene * corner);
      const Eigen::Vector2d edge =
          Project(camera, T_camera_scene * (middle + kBoard * (corner - middle)));
      seen.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
      board.emplace_back(cvRound(edge.x()), cvRound(edge.y()));
    }
    cv::fillConvexPoly(gray, board, cv::Scalar(235));
    const cv::Mat print = PrintOf(dictionary, id);
    const float end = static_cast<float>(print.cols) - 0.5F;
    const std::vector<cv::Point2f> corners = {
        {-0.5F, -0.5F}, {end, -0.5F}, {end, end}, {-0.5F, end}};
    cv::warpPerspective(print, gray, cv::getPerspectiveTransform(corners, seen), gray.size(),
                        cv::INTER_LINEAR, cv::BORDER_TRANSPARENT);
  }
  cv::Mat color;
  cv::cvtColor(gray, color, cv::COLOR_GRAY2RGB);
  return color;
}

}  // namespace

Scene ScannedBody() {
  SyntheticOptions options;
  options.T_reference_body.translation() = kPlace;
  return MakeSyntheticScene(options);
}

Eigen::Vector3d MiddleOfBody() { return kPlace + BodyCentroid(BodyShape::kTorso); }

RestFrames::RestFrames(const Scene& scene, double side, unsigned seed)
    : scene_(scene), random_(seed) {
  constexpr double kElevation_rad = 60 * kDegree;
  const Eigen::Vector3d towards(0.0, side * std::cos(kElevation_rad), std::sin(kElevation_rad));
  const Eigen::Vector3d z = -towards, x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_scene_camera = Pose::Identity();
  T_scene_camera.linear() << x, z.cross(x), z;
  T_scene_camera.translation() = MiddleOfBody() + 1.05 * towards;
  T_camera_scene_ = T_scene_camera.inverse();
  Render();
}

StreamInfo RestFrames::info() const {
  StreamInfo info;
  info.intrinsics = Camera();
  info.room_markers = scene_.room_markers;
  return info;
}

void RestFrames::Move(const Pose& T_motion) {
  T_motion_ = T_motion;
  Render();
}

void RestFrames::Push(const Eigen::Vector3d& shift_m) {
  T_camera_scene_.translation() += shift_m;
  Render();
}

void RestFrames::Render() {
  TriangleMesh still = MeshOfHeightMap(*scene_.height_map, {}, {.decimation = 2});
  TriangleMesh raised = still;
  const Eigen::Vector3f belly = MiddleOfBody().cast<float>();
  for (std::size_t i = 0; i < still.vertices.size(); ++i) {
    Eigen::Vector3f& p = still.vertices[i];
    if (p.z() < kOnSupport_m) continue;
    const float share = std::exp(-(p - belly).head<2>().squaredNorm() / 0.03F);
    const Eigen::Vector3f up = p + static_cast<float>(kBelly_m) * share * Eigen::Vector3f::UnitZ();
    p = (T_motion_ * p.cast<double>()).cast<float>();
    raised.vertices[i] = (T_motion_ * up.cast<double>()).cast<float>();
  }
  exhaled_m_ = RenderDepth(still, T_camera_scene_, Camera());
  inhaled_m_ = RenderDepth(raised, T_camera_scene_, Camera());
  color_ = Photograph(scene_, T_camera_scene_);
}

Frame RestFrames::At(double time_s, bool covered) {
  Frame frame;
  frame.index = next_++;
  frame.color_time_s = frame.depth_time_s = time_s;
  frame.color_rgb = color_;
  constexpr double kSteps = 16.0;
  double breath = std::pow(std::sin(std::numbers::pi * time_s / kBreath_s), 4);
  if (noise_m_ == 0.0F) breath = std::round(kSteps * breath) / kSteps;
  cv::addWeighted(exhaled_m_, 1.0 - breath, inhaled_m_, breath, 0.0, frame.depth_m);
  if (covered) frame.depth_m.setTo(0.6, frame.depth_m > 0.0);
  std::normal_distribution<float> noise;
  for (int row = 0; row < frame.depth_m.rows; ++row) {
    auto* z = frame.depth_m.ptr<float>(row);
    for (int column = 0; column < frame.depth_m.cols; ++column) {
      const bool is_edge =
          exhaled_m_.at<float>(row, column) == 0.0F || inhaled_m_.at<float>(row, column) == 0.0F;
      z[column] = is_edge ? 0.0F : stretch_ * z[column] + noise_m_ * noise(random_);
    }
  }
  return frame;
}

}  // namespace plumb::test
