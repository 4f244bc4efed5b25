// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/tracking/synthetic_map.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <random>

#include <Eigen/Geometry>

namespace plumb::synthetic {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kColorToDepth_s = 0.012;
constexpr double kBoardHeight = 0.06;  // Over the landscape, so that no hill pierces a board.
constexpr double kBoardSide = 0.132;

struct Camera {
  Intrinsics stated;
  CalibrationModel sensor;

  [[nodiscard]] double scale() const { return stated.width / 640.0; }
  [[nodiscard]] Vector2d ToPixel(const Vector3d& p) const {
    const auto& l = sensor.lens;
    const auto& d = stated.distortion;
    const double x = p.x() / p.z();
    const double y = p.y() / p.z();
    const double r2 = x * x + y * y;
    const double f = 1 + (d[0] + l[4]) * r2 + (d[1] + l[5]) * r2 * r2 + d[4] * r2 * r2 * r2;
    const double p1 = d[2] + l[6];
    const double p2 = d[3] + l[7];
    const double xd = x * f + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    const double yd = y * f + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    return {stated.fx * (1 + l[0]) * xd + stated.cx + l[2] * scale(),
            stated.fy * (1 + l[1]) * yd + stated.cy + l[3] * scale()};
  }
  [[nodiscard]] double Share(double row) const { return (row + 0.5) / stated.height - 0.5; }
  [[nodiscard]] Vector2d Centred(const Vector2d& px) const {
    return {(px.x() + 0.5 - stated.width / 2.0) / (stated.width / 2.0),
            (px.y() + 0.5 - stated.height / 2.0) / (stated.width / 2.0)};
  }
  // What the depth camera says of a true depth.
  [[nodiscard]] double Measured(double z, const Vector2d& centred) const {
    const auto& d = sensor.depth;
    double raw = (z - d[1] - d[2] * centred.squaredNorm()) /
                 (1 + d[0] + d[6] * centred.x() + d[7] * centred.y());
    // A field has no inverse in closed form; the error shrinks to a hundredth in each round.
    const bool has_field =
        std::any_of(d.begin() + kDepthField, d.end(), [](double term) { return term != 0; });
    for (int round = 0; has_field && round < 5; ++round)
      raw += z - sensor.CorrectedDepth(raw, centred);
    return raw;
  }
};

Pose Moved(const MapKeyframe& keyframe, double dt_s) {
  Pose T = Pose::Identity();
  const Vector3d w = keyframe.velocity_per_s.head<3>() * dt_s;
  if (w.norm() > 0) T.linear() = Eigen::AngleAxisd(w.norm(), w.normalized()).toRotationMatrix();
  T.translation() = keyframe.velocity_per_s.tail<3>() * dt_s;
  return keyframe.T_world_color * T;
}

// The row that sees a point decides when it is seen.
std::optional<Vector2d> Seen(const Camera& camera, const MapKeyframe& keyframe,
                             const Vector3d& p_world) {
  Vector2d px(0, camera.stated.height / 2.0);
  for (int i = 0; i < 6; ++i) {
    const Vector3d p =
        Moved(keyframe, camera.sensor.readout_s[0] * camera.Share(px.y())).inverse() * p_world;
    if (p.z() < 0.1) return std::nullopt;
    px = camera.ToPixel(p);
  }
  if (px.x() < 3 || px.y() < 3 || px.x() > camera.stated.width - 4 ||
      px.y() > camera.stated.height - 4)
    return std::nullopt;
  return px;
}

double DepthTime(const Camera& camera, double row) {
  return kColorToDepth_s + camera.sensor.depth[5] + camera.sensor.depth[8] * camera.Share(row);
}

// Ideal coordinates of a pixel.
Vector3d RayOf(const Camera& camera, const Vector2d& px) {
  Vector3d ray(0, 0, 1);
  for (int i = 0; i < 8; ++i) {
    const Vector2d off = px - camera.ToPixel(ray);
    ray += Vector3d(off.x() / camera.stated.fx, off.y() / camera.stated.fy, 0);
  }
  return ray;
}

// Depth along a ray: of the landscape by bisection from above, or of a board before it.
double CastDepth(const Pose& T_world_camera, const Vector3d& ray,
                 const std::map<int, MapMarker>& boards) {
  const Vector3d origin = T_world_camera.translation();
  const Vector3d direction = T_world_camera.linear() * ray;
  double low = 0.4;
  double high = 1.6;
  for (int i = 0; i < 20; ++i) {
    const double z = 0.5 * (low + high);
    const Vector3d p = origin + z * direction;
    (p.z() > Height(p.x(), p.y()) ? low : high) = z;
  }
  for (const auto& [id, board] : boards) {
    const Vector3d normal = board.T_world_marker.linear().col(2);
    const double z =
        normal.dot(board.T_world_marker.translation() - origin) / normal.dot(direction);
    const Vector3d p = board.T_world_marker.linear().transpose() *
                       (origin + z * direction - board.T_world_marker.translation());
    if (std::abs(p.x()) < kBoardSide / 2 && std::abs(p.y()) < kBoardSide / 2)
      low = std::min(low, z);
  }
  return low;
}

cv::Mat RenderDepth(const Camera& camera, const MapKeyframe& keyframe,
                    const std::map<int, MapMarker>& boards, double noise_m, std::mt19937& random) {
  const Intrinsics& k = camera.stated;
  const auto& l = camera.sensor.lens;
  const auto& d = camera.sensor.depth;
  std::normal_distribution<double> normal;
  cv::Mat depth(k.height, k.width, CV_32FC1);
  for (int r = 0; r < k.height; ++r) {
    const Pose T = Moved(keyframe, DepthTime(camera, r));
    for (int c = 0; c < k.width; ++c) {
      // The depth image lies to the right of and below the colour image by d[3], d[4].
      const Vector3d ray(
          (c - d[3] * camera.scale() - k.cx - l[2] * camera.scale()) / (k.fx * (1 + l[0])),
          (r - d[4] * camera.scale() - k.cy - l[3] * camera.scale()) / (k.fy * (1 + l[1])), 1.0);
      depth.at<float>(r, c) =
          static_cast<float>(camera.Measured(CastDepth(T, ray, boards), camera.Centred({c, r})) +
                             noise_m * normal(random));
    }
  }
  return depth;
}

// What the depth image shows at a pixel of the colour image, and the slope of its inverse.
KeypointObservation ReadDepth(const Camera& camera, const MapKeyframe& keyframe, int landmark,
                              const Vector2d& px) {
  const Vector2d shift(camera.sensor.depth[kDepthShiftX], camera.sensor.depth[kDepthShiftY]);
  const auto reading = [&](const Vector2d& at) {
    const Vector3d ray = RayOf(camera, at - camera.scale() * shift);
    const Pose T = Moved(keyframe, DepthTime(camera, at.y()));
    return camera.Measured(CastDepth(T, ray, {}), camera.Centred(at));
  };
  KeypointObservation observation{landmark, px, reading(px)};
  const auto slope = [&](const Vector2d& step) {
    return (1.0 / reading(px + step) - 1.0 / reading(px - step)) / 2.0;
  };
  observation.inverse_depth_slope = {slope({1, 0}), slope({0, 1})};
  return observation;
}

Pose LookDown(const Vector3d& position, const Vector3d& tilt) {
  Pose T = Pose::Identity();
  T.linear() = Vector3d(1, -1, -1).asDiagonal();
  T.linear() *= (Eigen::AngleAxisd(tilt.x(), Vector3d::UnitX()) *
                 Eigen::AngleAxisd(tilt.y(), Vector3d::UnitY()) *
                 Eigen::AngleAxisd(tilt.z(), Vector3d::UnitZ()))
                    .toRotationMatrix();
  T.translation() = position;
  return T;
}

void PlaceMarkers(TrackingMap& map) {
  for (int id = 0; id < 6; ++id) {
    const double x = -0.35 + 0.28 * (id % 3);
    const double y = id < 3 ? -0.25 : 0.25;
    Pose T = Pose::Identity();
    T.linear() =
        (Eigen::AngleAxisd(0.4 * id, Vector3d::UnitZ()) * Eigen::AngleAxisd(0.1, Vector3d::UnitX()))
            .toRotationMatrix();
    T.translation() = Vector3d(x, y, Height(x, y) + kBoardHeight);
    map.markers[id] = {T, 0};
  }
}

void ObserveMarkers(const Camera& camera, double noise, std::mt19937& random, TrackingMap& map) {
  std::normal_distribution<double> normal;
  constexpr double h = kMarkerLength / 2;
  const std::array<Vector3d, 4> in_marker = {Vector3d(-h, h, 0), Vector3d(h, h, 0),
                                             Vector3d(h, -h, 0), Vector3d(-h, -h, 0)};
  for (MapKeyframe& keyframe : map.keyframes) {
    for (auto& [id, marker] : map.markers) {
      ImageCorners ideal;
      bool whole = true;
      for (std::size_t i = 0; i < 4 && whole; ++i) {
        const auto px = Seen(camera, keyframe, marker.T_world_marker * in_marker[i]);
        whole = px.has_value();
        if (whole) ideal[i] = *px;
      }
      if (!whole) continue;
      MarkerObservation observation{.id = id, .corners = ideal, .sigma_px = {}};
      observation.sigma_px.fill(std::max(0.01, noise));
      for (std::size_t i = 0; i < 4; ++i) {
        const Vector2d inward = (ideal[(i + 1) % 4] - ideal[i]).normalized() +
                                (ideal[(i + 3) % 4] - ideal[i]).normalized();
        observation.corners[i] += camera.sensor.edge_bias_px[0] * camera.scale() * inward;
        observation.corners[i] += noise * Vector2d(normal(random), normal(random));
      }
      keyframe.data.markers.push_back(observation);
      ++marker.num_views;
    }
  }
}

void AddLandmarks(const Camera& camera, const MapOptions& options, std::mt19937& random,
                  TrackingMap& map) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int i = 0; i < options.num_landmarks; ++i) {
    Landmark landmark;
    const double x = 0.7 * uniform(random);
    const double y = 0.5 * uniform(random);
    landmark.p_world = {x, y, Height(x, y)};
    // Boards hide what is under and behind them.
    const auto hides = [&](const auto& board) {
      return (board.second.T_world_marker.translation() - landmark.p_world).norm() < 0.17;
    };
    if (std::any_of(map.markers.begin(), map.markers.end(), hides)) landmark.usable = false;
    for (MapKeyframe& keyframe : map.keyframes) {
      if (!landmark.usable) break;
      auto px = Seen(camera, keyframe, landmark.p_world);
      if (!px) continue;
      if (options.read_depth_at_pixels) {
        keyframe.keypoints.push_back(ReadDepth(camera, keyframe, i, *px));
        ++landmark.num_observations;
        continue;
      }
      const Vector3d p = Moved(keyframe, DepthTime(camera, px->y())).inverse() * landmark.p_world;
      double z = camera.Measured(p.z(), camera.Centred(*px));
      z += options.depth_noise_sigmas * normal(random) * (0.0012 + 0.0019 * (z - 0.4) * (z - 0.4));
      *px += options.pixel_noise * Vector2d(normal(random), normal(random));
      keyframe.keypoints.push_back({i, *px, z, Vector2d::Zero()});
      ++landmark.num_observations;
    }
    map.landmarks.push_back(landmark);
  }
}

}  // namespace

double Height(double x, double y) {
  return 0.10 * std::exp(-((x - 0.1) * (x - 0.1) + (y + 0.05) * (y + 0.05)) / 0.03) +
         0.07 * std::exp(-((x + 0.25) * (x + 0.25) + (y - 0.1) * (y - 0.1)) / 0.015) +
         0.03 * std::sin(9 * x) * std::cos(7 * y);
}

TrueMap MakeTrueMap(const MapOptions& options) {
  TrueMap truth;
  truth.stated.width = 320;
  truth.stated.height = 240;
  truth.stated.fx = 262.5;
  truth.stated.fy = 263.1;
  truth.stated.cx = 160.3;
  truth.stated.cy = 118.9;
  if (!options.dense) truth.stated.distortion = {0.05, -0.12, 0.0007, -0.0004, 0.02};
  const Camera camera{truth.stated, options.sensor};
  std::mt19937 random(7);
  if (options.markers) PlaceMarkers(truth.map);
  const DenseViewMaker maker(truth.stated);
  for (int i = 0; i < options.num_keyframes; ++i) {
    const double s = options.num_keyframes > 1 ? 2.0 * i / (options.num_keyframes - 1) - 1.0 : 0.0;
    MapKeyframe keyframe;
    keyframe.data.frame_index = 5 * i;
    keyframe.data.color_time_s = 100.0 + 0.4 * i;
    keyframe.data.depth_time_s = keyframe.data.color_time_s + kColorToDepth_s;
    keyframe.T_world_color =
        LookDown({0.3 * s, 0.14 * std::sin(3.5 * s), 0.9 + 0.08 * std::cos(5 * s)},
                 {0.22 * std::sin(4 * s), 0.2 * std::cos(6 * s), 0.35 * std::sin(2.6 * s)});
    keyframe.velocity_per_s << 0.25 * std::cos(7 * s), -0.3 * std::sin(5 * s),
        0.2 * std::cos(4 * s), 0.30 * std::cos(9 * s), 0.35 * std::sin(8 * s),
        0.25 * std::cos(11 * s + 1);
    keyframe.data.view.intrinsics = truth.stated;
    if (options.dense) {
      keyframe.data.view.depth_m =
          RenderDepth(camera, keyframe, truth.map.markers, options.image_noise_m, random);
      keyframe.dense = maker.Make(keyframe.data.view.depth_m);
    }
    truth.map.keyframes.push_back(std::move(keyframe));
  }
  AddLandmarks(camera, options, random, truth.map);
  ObserveMarkers(camera, options.pixel_noise, random, truth.map);
  return truth;
}

void Disturb(TrackingMap& map, double translation_m, double rotation_rad) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto vector = [&] { return Vector3d(uniform(random), uniform(random), uniform(random)); };
  const auto move = [&](Pose& T) {
    T.linear() *= Eigen::AngleAxisd(rotation_rad, vector().normalized()).toRotationMatrix();
    T.translation() += translation_m * vector();
  };
  for (std::size_t k = 1; k < map.keyframes.size(); ++k) move(map.keyframes[k].T_world_color);
  for (auto& [id, marker] : map.markers) move(marker.T_world_marker);
  for (Landmark& landmark : map.landmarks) landmark.p_world += translation_m * vector();
}

TrackingMap WithKeypointDepthsOff(TrackingMap map, double by_m) {
  for (MapKeyframe& keyframe : map.keyframes)
    for (KeypointObservation& keypoint : keyframe.keypoints) keypoint.z_m += by_m;
  return map;
}

MapError Compare(const TrackingMap& map, const TrackingMap& truth) {
  MapError error;
  for (std::size_t k = 0; k < truth.keyframes.size(); ++k) {
    const Pose difference =
        truth.keyframes[k].T_world_color.inverse() * map.keyframes[k].T_world_color;
    error.translation_m = std::max(error.translation_m, difference.translation().norm());
    error.rotation_rad =
        std::max(error.rotation_rad, Eigen::AngleAxisd(difference.linear()).angle());
  }
  return error;
}

}  // namespace plumb::synthetic
