// SPDX-License-Identifier: Apache-2.0
// Open3D's multiway registration, as in its tutorial of that name: ICP of pairs, their information
// matrices, then a pose graph. The tutorial's coarse ICP is left out, because the tracker's poses
// replace it. Started from the true poses, or from poses that were 10 mm off, its error was within
// 0.03 mm of the one that it has from the tracker's poses (placement_1 of the suite nine, seed 41,
// with an overlap of 0.3), so the start is not what limits it. Voxels of 1 cm took four times as
// long and made the surface worse. Coloured ICP of the pairs is left out: it ended 10 to 15 mm from
// the truth, perhaps because colour and depth are taken at different times, which would not show
// the library fairly.
#include <memory>

#include <fmt/format.h>
#include <open3d/geometry/KDTreeSearchParam.h>
#include <open3d/geometry/PointCloud.h>
#include <open3d/pipelines/registration/GlobalOptimization.h>
#include <open3d/pipelines/registration/PoseGraph.h>
#include <open3d/pipelines/registration/Registration.h>

#include "algo/base/errors.hpp"
#include "tests/bench/peers.hpp"

namespace plumb {
namespace {

namespace registration = open3d::pipelines::registration;
using Cloud = open3d::geometry::PointCloud;
using Clouds = std::vector<std::shared_ptr<Cloud>>;

// Fraction of a view's points that must lie near another view's for the two to be aligned, unless
// they follow each other. With 0.3 it takes 1.6 times as long for the same accuracy.
constexpr double kMinOverlap = 0.6;

std::shared_ptr<Cloud> Prepare(const PointCloud& cloud) {
  constexpr int kMaxNeighbours = 30;
  Cloud whole;
  for (const Eigen::Vector3f& p : cloud.points) whole.points_.push_back(p.cast<double>());
  std::shared_ptr<Cloud> thinned = whole.VoxelDownSample(kPeerVoxel_m);
  thinned->EstimateNormals(
      open3d::geometry::KDTreeSearchParamHybrid(2.0 * kPeerVoxel_m, kMaxNeighbours));
  return thinned;
}

Eigen::Matrix4d Align(const Cloud& source, const Cloud& target, const Pose& T_target_source) {
  const registration::RegistrationResult result =
      registration::RegistrationICP(source, target, kPeerMaxDistance_m, T_target_source.matrix(),
                                    registration::TransformationEstimationPointToPlane());
  return result.transformation_;
}

/// Nodes at the tracker's poses. Edges between neighbours are kept ("odometry"); all others may
/// be rejected ("loop closure").
registration::PoseGraph MakeGraph(std::span<const PeerView> views, const Clouds& clouds) {
  registration::PoseGraph graph;
  for (const PeerView& view : views) graph.nodes_.emplace_back(view.T_world_camera.matrix());
  for (std::size_t i = 0; i < views.size(); ++i) {
    for (std::size_t j = i + 1; j < views.size(); ++j) {
      const Pose T_j_i = views[j].T_world_camera.inverse() * views[i].T_world_camera;
      const double overlap = registration::EvaluateRegistration(*clouds[i], *clouds[j],
                                                                kPeerMaxDistance_m, T_j_i.matrix())
                                 .fitness_;
      const bool are_neighbours = j == i + 1;
      if (!are_neighbours && overlap < kMinOverlap) continue;
      // Without an overlap ICP has nothing to align: the tracker's motion stays, with little
      // weight, so that the graph does not fall apart.
      const Eigen::Matrix4d aligned =
          overlap > 0.0 ? Align(*clouds[i], *clouds[j], T_j_i) : T_j_i.matrix();
      const Eigen::Matrix6d information =
          overlap > 0.0 ? registration::GetInformationMatrixFromPointClouds(
                              *clouds[i], *clouds[j], kPeerMaxDistance_m, aligned)
                        : Eigen::Matrix6d(Eigen::Matrix6d::Identity());
      graph.edges_.emplace_back(static_cast<int>(i), static_cast<int>(j), aligned, information,
                                !are_neighbours);
    }
  }
  return graph;
}

std::vector<Pose> SolveGraph(std::span<const PeerView> views) {
  Clouds clouds;
  for (const PeerView& view : views) clouds.push_back(Prepare(view.cloud_in_camera));
  registration::PoseGraph graph = MakeGraph(views, clouds);
  registration::GlobalOptimizationOption options;
  options.max_correspondence_distance_ = kPeerMaxDistance_m;
  options.reference_node_ = 0;
  registration::GlobalOptimization(graph, registration::GlobalOptimizationLevenbergMarquardt(),
                                   registration::GlobalOptimizationConvergenceCriteria(), options);
  std::vector<Pose> T_world_camera;
  for (const registration::PoseGraphNode& node : graph.nodes_) {
    T_world_camera.emplace_back(Eigen::Matrix4d(node.pose_));
    if (!IsFinite(T_world_camera.back()))
      throw DataError(
          fmt::format("Open3D's pose graph: keyframe {} of {} has a pose that is not finite, so "
                      "there is no row to print; try another recording",
                      T_world_camera.size() - 1, graph.nodes_.size()));
  }
  return T_world_camera;
}

}  // namespace

PeerMethod Open3dMethod() {
  return {
      .name = "Open3D: point-to-plane ICP of pairs, pose graph",
      .parameters = fmt::format(
          "voxels of {:.0f} cm, normals within 2 voxels, ICP within {:.0f} cm of all pairs that "
          "follow each other or overlap by {:.0f} %, GlobalOptimization by "
          "Levenberg-Marquardt, else the defaults",
          100.0 * kPeerVoxel_m, 100.0 * kPeerMaxDistance_m, 100.0 * kMinOverlap),
      .solve = SolveGraph};
}

}  // namespace plumb
