// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/board_layout.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <stdexcept>

#include "algo/base/units.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;

constexpr int kViewsPerSweep = 16;

// A board on the support, with its lowest corner two millimetres above it.
Pose BoardPose(double x, double y, double yaw, double tilt, double tilt_direction) {
  Pose T = Pose::Identity();
  const Vector3d axis(std::cos(tilt_direction), std::sin(tilt_direction), 0.0);
  T.linear() = (Eigen::AngleAxisd(tilt, axis) * Eigen::AngleAxisd(yaw, Vector3d::UnitZ()))
                   .toRotationMatrix();
  double lowest = 0;
  for (const Vector3d& corner : CornersInMarkerFrame(kBoardSide))
    lowest = std::min(lowest, (T.linear() * corner).z());
  T.translation() = Vector3d(x, y, 2 * kMillimetre - lowest);
  return T;
}

bool FreeOfBodies(const Pose& T_world_board, const std::vector<LayoutScene>& scenes) {
  constexpr double kClearance = 0.012;
  for (const LayoutScene& scene : scenes) {
    const Pose T_body_board = scene.T_world_body.inverse() * T_world_board;
    for (int i = 0; i < 25; ++i) {
      const Vector3d p((i % 5 - 2) * kBoardSide / 4, (i / 5 - 2) * kBoardSide / 4, 0.01);
      if (scene.body->Distance((T_body_board * p).cast<float>()) < kClearance) return false;
    }
  }
  return true;
}

// Moments spread over all sweeps, with the boards that each of them sees.
class Views {
 public:
  Views(const std::vector<LayoutScene>& scenes, const Intrinsics& camera)
      : scenes_(scenes), camera_(camera), seen_(scenes.size() * kViewsPerSweep, 0) {
    for (const LayoutScene& scene : scenes) {
      const Trajectory trajectory(scene.sweep);
      for (int i = 0; i < kViewsPerSweep; ++i)
        T_world_camera_.push_back(
            trajectory.T_world_camera(scene.sweep.duration_s * (i + 0.5) / kViewsPerSweep));
    }
  }

  [[nodiscard]] bool Sees(std::size_t view, const Pose& T_world_board) const {
    constexpr double kBorder = 10.0;  // Pixels
    const Pose T_camera_board = T_world_camera_[view].inverse() * T_world_board;
    for (const Vector3d& corner : CornersInMarkerFrame(kMarkerLength)) {
      const Vector3d p = T_camera_board * corner;
      if (p.z() < 0.2) return false;
      const Eigen::Vector2d pixel = Project(camera_, p);
      if (pixel.x() < kBorder || pixel.y() < kBorder || pixel.x() > camera_.width - kBorder ||
          pixel.y() > camera_.height - kBorder)
        return false;
    }
    const LayoutScene& scene = scenes_[view / kViewsPerSweep];
    const Pose T_body_world = scene.T_world_body.inverse();
    const Eigen::Vector3f from = (T_body_world * T_world_camera_[view].translation()).cast<float>();
    const Vector3d grown(1.1, 1.1, 1.0);
    for (const Vector3d& corner : CornersInMarkerFrame(kMarkerLength)) {
      const Eigen::Vector3f way =
          (T_body_world * (T_world_board * corner.cwiseProduct(grown))).cast<float>() - from;
      if (std::isfinite(scene.body->Intersect(from, way.normalized(), 0.0F, way.norm())))
        return false;
    }
    return true;
  }

  // Benefit of another board: views count for more where few boards are seen so far.
  [[nodiscard]] double Worth(const Pose& T_world_board) const {
    double worth = 0;
    for (std::size_t view = 0; view < seen_.size(); ++view) {
      if (Sees(view, T_world_board)) worth += 1.0 / ((1.0 + seen_[view]) * (1.0 + seen_[view]));
    }
    return worth;
  }

  // The smallest fraction of its sweep in which any scene sees the board.
  [[nodiscard]] double LeastFraction(const Pose& T_world_board) const {
    double least = 1.0;
    for (std::size_t scene = 0; scene < scenes_.size(); ++scene) {
      int sights = 0;
      for (std::size_t i = 0; i < kViewsPerSweep; ++i)
        sights += Sees(scene * kViewsPerSweep + i, T_world_board) ? 1 : 0;
      least = std::min(least, static_cast<double>(sights) / kViewsPerSweep);
    }
    return least;
  }

  void Add(const Pose& T_world_board) {
    for (std::size_t view = 0; view < seen_.size(); ++view)
      seen_[view] += Sees(view, T_world_board) ? 1 : 0;
  }

 private:
  const std::vector<LayoutScene>& scenes_;
  const Intrinsics& camera_;
  std::vector<Pose> T_world_camera_;
  std::vector<int> seen_;
};

Pose ReferencePose(const LayoutRegion& region, const std::vector<LayoutScene>& scenes,
                   const Views& views, RandomStream& random) {
  const double yaw = random.Within(1.5 * kDegree);
  const double tilt = 0.3 * kDegree * random.Uniform();
  const double tilt_direction = random.Uniform(0.0, kTwoPi);
  std::optional<Pose> best;
  double best_fraction = 0;
  for (double x = -region.half_length + 0.05; x < -0.42; x += 0.03) {
    for (double y = -region.half_width + 0.02; y < -0.28; y += 0.03) {
      const Pose T = BoardPose(x, y, yaw, tilt, tilt_direction);
      if (!FreeOfBodies(T, scenes)) continue;
      const double fraction = views.LeastFraction(T);
      if (fraction > best_fraction) {
        best_fraction = fraction;
        best = T;
      }
    }
  }
  if (!best)
    throw std::invalid_argument(
        "simulate: the sweeps are too short to see the reference marker in every scene");
  return *best;
}

}  // namespace

std::vector<Board> LayBoards(const LayoutRegion& region, const std::vector<LayoutScene>& scenes,
                             const Intrinsics& camera, std::uint64_t seed) {
  RandomStream random(Hash(seed, 61));
  Views views(scenes, camera);
  std::vector<Board> boards;
  std::set<int> used;
  const auto lay = [&](const Pose& T_world_marker) {
    int id = 0;
    do id = static_cast<int>(random.Uniform() * 250.0);
    while (!used.insert(id).second);
    boards.push_back({id, T_world_marker});
    views.Add(T_world_marker);
  };
  lay(ReferencePose(region, scenes, views, random));

  constexpr int kTriesPerBoard = 400;
  constexpr int kChoicesPerBoard = 14;
  constexpr double kSpacing = 0.215;  // Between centres; a board's diagonal is 0.187.
  while (boards.size() < region.num_boards) {
    std::optional<Pose> best;
    double best_worth = -1.0;
    int choices = 0;
    for (int attempt = 0; attempt < kTriesPerBoard && choices < kChoicesPerBoard; ++attempt) {
      const double x = random.Within(region.half_length);
      const double y = random.Within(region.half_width);
      // Most lie almost flat, some are propped up.
      const double tilt =
          (random.Uniform() < 0.75 ? random.Uniform(0.0, 2.0) : random.Uniform(3.0, 9.0)) * kDegree;
      const double yaw = random.Uniform(0.0, kTwoPi);
      const Pose T = BoardPose(x, y, yaw, tilt, random.Uniform(0.0, kTwoPi));
      const bool crowded = std::any_of(boards.begin(), boards.end(), [&](const Board& other) {
        return (other.T_world_marker.translation() - T.translation()).head<2>().norm() < kSpacing;
      });
      if (crowded || !FreeOfBodies(T, scenes)) continue;
      ++choices;
      const double worth = views.Worth(T);
      if (worth > best_worth) {
        best_worth = worth;
        best = T;
      }
    }
    if (!best) break;  // The region is full.
    lay(*best);
  }
  return boards;
}

}  // namespace plumb::simulated
