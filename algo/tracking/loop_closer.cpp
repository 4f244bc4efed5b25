// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/loop_closer.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <Eigen/SparseCholesky>

#include "algo/tracking/view_geometry.hpp"

namespace plumb {
namespace {

constexpr int kMaxCandidates = 4;
// Common landmarks above which keyframes count as already covisible.
constexpr int kSharedEnough = 10;
constexpr int kCovisible = 15;  // Common landmarks that form a constraint.
// Largest plausible drift: a constant, and the same per metre travelled.
constexpr double kDrift_m = 0.30;
constexpr double kDriftPerMetre = 0.05;
constexpr double kTurn_rad = 0.30;
constexpr double kTurnPerMetre = 0.03;  // Radians.
constexpr int kMaxRounds = 15;
// The same for all links; only the ratio of these two matters.
constexpr double kLinkSigma_m = 0.002;
constexpr double kLinkSigma_rad = 0.001;

// Length of the camera path from each keyframe to the newest.
std::vector<double> WayToNewest(const TrackingMap& map) {
  std::vector<double> way(map.keyframes.size(), 0.0);
  for (std::size_t k = map.keyframes.size() - 1; k-- > 0;)
    way[k] = way[k + 1] + (map.keyframes[k + 1].T_world_color.translation() -
                           map.keyframes[k].T_world_color.translation())
                              .norm();
  return way;
}

DriftBound BoundOf(double way_m) {
  return {kDrift_m + kDriftPerMetre * way_m, kTurn_rad + kTurnPerMetre * way_m};
}

// Number of landmarks that the newest keyframe shares with each other keyframe.
std::vector<int> SharedWithNewest(const TrackingMap& map) {
  std::vector<bool> seen(map.landmarks.size(), false);
  for (const KeypointObservation& o : map.keyframes.back().keypoints)
    seen[static_cast<std::size_t>(o.landmark)] = true;
  std::vector<int> shared;
  for (const MapKeyframe& keyframe : map.keyframes) {
    shared.push_back(static_cast<int>(
        std::count_if(keyframe.keypoints.begin(), keyframe.keypoints.end(),
                      [&](const auto& o) { return seen[static_cast<std::size_t>(o.landmark)]; })));
  }
  return shared;
}

// The present constraints of the map: each keyframe's link to its predecessor and to the keyframes
// with common landmarks.
std::vector<KeyframeLink> LinksOf(const TrackingMap& map) {
  std::vector<std::vector<int>> seen_by(map.landmarks.size());
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    for (const KeypointObservation& o : map.keyframes[k].keypoints)
      seen_by[static_cast<std::size_t>(o.landmark)].push_back(static_cast<int>(k));
  std::map<std::pair<int, int>, int> shared;
  for (const std::vector<int>& keyframes : seen_by)
    for (std::size_t i = 0; i < keyframes.size(); ++i)
      for (std::size_t j = i + 1; j < keyframes.size(); ++j) ++shared[{keyframes[i], keyframes[j]}];
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (const std::optional<int> previous = map.keyframes[k].previous)
      shared[{*previous, static_cast<int>(k)}] += kCovisible;
  std::vector<KeyframeLink> links;
  for (const auto& [pair, count] : shared) {
    if (count < kCovisible || pair.first == pair.second) continue;
    const auto& a = map.keyframe(pair.first);
    const auto& b = map.keyframe(pair.second);
    links.push_back({pair.first, pair.second, a.T_world_color.inverse() * b.T_world_color});
  }
  return links;
}

// Gauss-Newton with the first pose fixed. False if the system cannot be solved; the poses are then
// unchanged.
bool SolvePoseGraph(const std::vector<KeyframeLink>& links, std::vector<Pose>& T_world) {
  const auto size = static_cast<Eigen::Index>(6 * T_world.size());
  std::vector<Pose> T = T_world;
  for (int round = 0; round < kMaxRounds; ++round) {
    std::vector<Eigen::Triplet<double>> entries;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
    const auto add = [&](int row, int column, const Matrix6d& block) {
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j < 6; ++j) entries.emplace_back(6 * row + i, 6 * column + j, block(i, j));
    };
    for (const KeyframeLink& link : links) {
      const LinkEquations equations =
          Linearise(link, T[static_cast<std::size_t>(link.a)], T[static_cast<std::size_t>(link.b)],
                    kLinkSigma_rad, kLinkSigma_m);
      add(link.a, link.a, equations.H.topLeftCorner<6, 6>());
      add(link.a, link.b, equations.H.topRightCorner<6, 6>());
      add(link.b, link.a, equations.H.bottomLeftCorner<6, 6>());
      add(link.b, link.b, equations.H.bottomRightCorner<6, 6>());
      gradient.segment<6>(6 * link.a) += equations.g.head<6>();
      gradient.segment<6>(6 * link.b) += equations.g.tail<6>();
    }
    // Fixes the first pose and all poses without a link.
    for (int i = 0; i < size; ++i) entries.emplace_back(i, i, i < 6 ? 1e12 : 1.0);
    Eigen::SparseMatrix<double> H(size, size);
    H.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(H);
    if (solver.info() != Eigen::Success) return false;
    const Eigen::VectorXd step = solver.solve(-gradient);
    if (!step.allFinite()) return false;
    for (std::size_t k = 1; k < T.size(); ++k)
      T[k] = T[k] * PoseFromTwist(step.segment<6>(static_cast<Eigen::Index>(6 * k)));
    if (step.lpNorm<Eigen::Infinity>() < 1e-6) break;
  }
  for (Pose& pose : T) pose = Orthonormalised(pose);
  T_world = std::move(T);
  return true;
}

}  // namespace

std::vector<int> LoopCandidates(const TrackingMap& map) {
  const int newest = static_cast<int>(map.keyframes.size()) - 1;
  if (newest < kLoopMinGap) return {};
  const std::vector<double> way = WayToNewest(map);
  const std::vector<int> shared = SharedWithNewest(map);
  std::vector<std::pair<double, int>> near;
  for (int k = 0; k + kLoopMinGap <= newest; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const MapKeyframe& older = map.keyframes[i];
    if (shared[i] >= kSharedEnough || (older.descriptors.empty() && older.gray.empty())) continue;
    const Pose& T_world_newest = map.keyframes.back().T_world_color;
    const Pose T = older.T_world_color.inverse() * T_world_newest;
    const DriftBound drift = BoundOf(way[i]);
    const double apart =
        std::max(0.0, T.translation().norm() - drift.translation_m) / ScaleOfView(older) +
        std::max(0.0, RotationAngle(T) - drift.rotation_rad);
    // Among those within reach, the ones whose views would overlap most without drift.
    if (apart < kViewReach) near.emplace_back(ViewDistance(older, T_world_newest), k);
  }
  std::sort(near.begin(), near.end());
  std::vector<int> candidates;
  for (const auto& [distance, k] : near) {
    const bool beside = std::any_of(candidates.begin(), candidates.end(),
                                    [k = k](int other) { return std::abs(other - k) < 2; });
    if (!beside) candidates.push_back(k);
    if (static_cast<int>(candidates.size()) == kMaxCandidates) break;
  }
  return candidates;
}

DriftBound LargestDrift(const TrackingMap& map, int older_keyframe) {
  return BoundOf(WayToNewest(map).at(static_cast<std::size_t>(older_keyframe)));
}

void DistributeLoopError(const std::vector<KeyframeLink>& links, TrackingMap& map) {
  std::vector<KeyframeLink> all = LinksOf(map);
  all.insert(all.end(), links.begin(), links.end());
  std::vector<Pose> T_world;
  for (const MapKeyframe& keyframe : map.keyframes) T_world.push_back(keyframe.T_world_color);
  if (!SolvePoseGraph(all, T_world)) return;

  std::vector<Pose> T_new_old;  // In the world frame.
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    T_new_old.push_back(T_world[k] * map.keyframes[k].T_world_color.inverse());
    map.keyframes[k].T_world_color = T_world[k];
  }
  for (Landmark& landmark : map.landmarks)
    landmark.p_world =
        T_new_old[static_cast<std::size_t>(landmark.first_keyframe)] * landmark.p_world;
  std::map<int, std::size_t> first_view;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    for (const MarkerObservation& marker : map.keyframes[k].data.markers)
      first_view.emplace(marker.id, k);
  for (auto& [id, marker] : map.markers)
    if (const auto k = first_view.find(id); k != first_view.end())
      marker.T_world_marker = T_new_old[k->second] * marker.T_world_marker;
}

}  // namespace plumb
