// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/deformation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/SparseCholesky>

#include "algo/base/check_stop.hpp"
#include "algo/base/robust_weights.hpp"
#include "algo/base/statistics.hpp"
#include "algo/motion/surface.hpp"

namespace plumb {
namespace {

constexpr double kSampleSpacing_m = 0.01;
constexpr double kSmoothing_m = 0.02;
constexpr double kNodeSpacing_m =
    0.06;  // about the width of a wrist, the smallest part that moves by itself
// enough for a body of 1.9 m; nodes of larger bodies are spaced more widely
constexpr std::size_t kMaxNodes = 600;
constexpr std::size_t kNodesOfSample = 4;
constexpr double kSigmaOfSample_m = 1.5e-3;  // noise of a fused surface at one sample
constexpr double kSigmaOfTurn_rad = 0.3;  // weak prior for nodes that are not constrained otherwise
// Prior that a node stays where the rigid motion placed it; without it a smooth surface could slide
// along itself. Cauchy weights release what has clearly moved.
constexpr double kSigmaOfShift_m = 2e-3;

// Search radius and weights of one stage of the optimisation.
struct DeformationStage {
  double radius_m;        // search radius for correspondences
  double min_normal_cos;  // cosine between the normals of the two surfaces
  double scale_m;         // scale of the Tukey weights
  double edge_sigma_m;    // allowed disagreement of neighbouring nodes (stiffness)
  int iterations;
};
// Measured between the two scans of sim-a, whose body is rigid, so that every displacement is an
// error: median 0.235 and 95th percentile 0.556 mm; with all radii halved 0.234 and 0.552, doubled
// 0.244 and 0.564 mm.
constexpr std::array<DeformationStage, 3> kStages = {{
    {.radius_m = 0.06,
     .min_normal_cos = 0.6,
     .scale_m = 0.015,
     .edge_sigma_m = 1e-3,
     .iterations = 6},
    {.radius_m = 0.04,
     .min_normal_cos = 0.7,
     .scale_m = 0.008,
     .edge_sigma_m = 2e-3,
     .iterations = 6},
    {.radius_m = 0.02,
     .min_normal_cos = 0.8,
     .scale_m = 0.004,
     .edge_sigma_m = 3e-3,
     .iterations = 6},
}};
// The Cauchy weights of the two priors: errors of twice their sigma weigh half.
constexpr double kRelease = 0.25;

struct Node {
  Eigen::Vector3d place_m;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();

  [[nodiscard]] Eigen::Vector3d Moved(const Eigen::Vector3d& p) const {
    return R * (p - place_m) + place_m + shift_m;
  }
};

struct Follower {
  std::array<std::uint32_t, kNodesOfSample> node{};
  std::array<double, kNodesOfSample> weight{};
};

struct Match {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double residual_m = 0.0;
  double weight = 0.0;  // 0: no correspondence
};

Surface BodySurface(const PointCloud& cloud, const Body& body) {
  const Surface all = MakeSurface(cloud, kSampleSpacing_m, kSmoothing_m);
  return Subset(all, [&](std::size_t i) { return body.Contains(all.points[i].cast<double>()); });
}

Surface MovedBack(Surface surface, const Pose& T_motion) {
  const Pose T_back = T_motion.inverse();
  for (Eigen::Vector3f& p : surface.points) p = (T_back * p.cast<double>()).cast<float>();
  for (Eigen::Vector3f& n : surface.normals) n = (T_back.linear() * n.cast<double>()).cast<float>();
  return surface;
}

// Samples that are at least `spacing_m` apart, in the samples' order; fewer than kMaxNodes + 1.
std::vector<Node> NodesOn(const Surface& surface) {
  std::vector<Node> nodes;
  for (double spacing_m = kNodeSpacing_m;; spacing_m *= 1.25) {
    nodes.clear();
    for (const Eigen::Vector3f& point : surface.points) {
      const Eigen::Vector3d p = point.cast<double>();
      const bool is_free = std::none_of(nodes.begin(), nodes.end(), [&](const Node& node) {
        return (node.place_m - p).squaredNorm() < spacing_m * spacing_m;
      });
      if (!is_free) continue;
      nodes.push_back({.place_m = p});
      if (nodes.size() > kMaxNodes) break;
    }
    if (nodes.size() <= kMaxNodes) return nodes;
  }
}

// The nearest nodes, each weighted by how much nearer it is than the next node after them.
Follower FollowerOf(const Eigen::Vector3d& p, const std::vector<Node>& nodes) {
  std::array<std::pair<double, std::uint32_t>, kNodesOfSample + 1> nearest;
  nearest.fill({1e9, 0});
  for (std::uint32_t k = 0; k < nodes.size(); ++k) {
    const std::pair<double, std::uint32_t> found = {(nodes[k].place_m - p).norm(), k};
    if (found >= nearest.back()) continue;
    nearest.back() = found;
    std::sort(nearest.begin(), nearest.end());
  }
  Follower follower;
  double sum = 0.0;
  for (std::size_t k = 0; k < kNodesOfSample; ++k) {
    if (nearest[k].first >= 1e9) break;  // the body has fewer nodes
    follower.node[k] = nearest[k].second;
    const double near = 1.0 - nearest[k].first / nearest.back().first;
    follower.weight[k] = near * near + 1e-9;
    sum += follower.weight[k];
  }
  for (double& weight : follower.weight) weight /= sum;
  return follower;
}

std::vector<Follower> FollowersOf(const Surface& surface, const std::vector<Node>& nodes) {
  std::vector<Follower> followers(surface.size());
  tbb::parallel_for(std::size_t{0}, surface.size(), [&](std::size_t i) {
    followers[i] = FollowerOf(surface.points[i].cast<double>(), nodes);
  });
  return followers;
}

// The normal equations by blocks: one 6 x 6 block for each pair of nodes that share a sample.
class NodeEquations {
 public:
  NodeEquations(std::size_t num_nodes, const std::vector<Follower>& followers)
      : num_nodes_(num_nodes) {
    for (std::size_t k = 0; k < num_nodes; ++k) (void)BlockOf(k, k);
    for (const Follower& follower : followers) {
      for (std::size_t a = 0; a < kNodesOfSample; ++a) {
        for (std::size_t b = 0; b < kNodesOfSample; ++b) {
          if (follower.weight[a] > 0 && follower.weight[b] > 0)
            (void)BlockOf(follower.node[a], follower.node[b]);
        }
      }
    }
    Clear();
  }

  void Clear() {
    blocks_.assign(index_.size(), Matrix6d::Zero());
    right_side_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(6 * num_nodes_));
  }
  void Add(std::size_t row, std::size_t column, const Matrix6d& block) {
    if (row >= column) blocks_[BlockOf(row, column)] += block;
  }
  void AddRight(std::size_t row, const Vector6d& values) {
    right_side_.segment<6>(static_cast<Eigen::Index>(6 * row)) += values;
  }
  /// Pairs of different nodes that share a sample, each listed once.
  [[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> Edges() const {
    std::vector<std::pair<std::size_t, std::size_t>> edges;
    for (const auto& [pair, block] : index_) {
      if (pair.first > pair.second) edges.push_back(pair);
    }
    return edges;
  }

  [[nodiscard]] std::optional<Eigen::VectorXd> Solve() {
    std::vector<Eigen::Triplet<double>> triplets;
    triplets.reserve(36 * blocks_.size());
    for (const auto& [pair, block] : index_) {
      for (int r = 0; r < 6; ++r) {
        for (int c = 0; c < 6; ++c)
          triplets.emplace_back(static_cast<int>(6 * pair.first) + r,
                                static_cast<int>(6 * pair.second) + c, blocks_[block](r, c));
      }
    }
    const auto size = static_cast<Eigen::Index>(6 * num_nodes_);
    Eigen::SparseMatrix<double> lower(size, size);
    lower.setFromTriplets(triplets.begin(), triplets.end());
    if (!is_analysed_) solver_.analyzePattern(lower);
    is_analysed_ = true;
    solver_.factorize(lower);
    if (solver_.info() != Eigen::Success) return std::nullopt;
    return solver_.solve(right_side_);
  }

 private:
  std::size_t BlockOf(std::size_t row, std::size_t column) {
    const auto key = std::pair(std::max(row, column), std::min(row, column));
    return index_.try_emplace(key, index_.size()).first->second;
  }

  std::size_t num_nodes_;
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> index_;  // lower triangle
  std::vector<Matrix6d> blocks_;
  Eigen::VectorXd right_side_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> solver_;
  bool is_analysed_ = false;
};

// One registration in progress.
class Registration {
 public:
  Registration(Surface reference, Surface current)
      : reference_(std::move(reference)),
        current_(std::move(current)),
        nodes_(NodesOn(reference_)),
        followers_(FollowersOf(reference_, nodes_)),
        equations_(nodes_.size(), followers_),
        edges_(equations_.Edges()) {}

  void Descend(const DeformationStage& stage, const std::stop_token& stop) {
    const NearestSample nearest(current_.points, stage.radius_m);
    for (int i = 0; i < stage.iterations; ++i) {
      CheckStop(stop);
      FindMatches(nearest, stage);
      if (!Step(stage)) return;
    }
    FindMatches(nearest, stage);
  }

  [[nodiscard]] Deformation Result() const {
    Deformation result;
    std::vector<double> lengths, residuals;
    for (std::size_t i = 0; i < reference_.size(); ++i) {
      const bool is_observed = matches_[i].weight > 0;
      const Eigen::Vector3f& p = reference_.points[i];
      const Eigen::Vector3d shift = Moved(i) - p.cast<double>();
      result.points.push_back(p);
      result.shifts_m.push_back(shift.cast<float>());
      result.observed.push_back(is_observed ? 1 : 0);
      if (!is_observed) continue;
      lengths.push_back(shift.norm());
      residuals.push_back(std::abs(matches_[i].residual_m));
    }
    if (lengths.empty()) return result;
    result.shift_median_m = TakeQuantile(lengths, 0.5);
    result.shift_p95_m = TakeQuantile(lengths, 0.95);
    result.residual_median_m = TakeQuantile(residuals, 0.5);
    result.residual_p95_m = TakeQuantile(residuals, 0.95);
    return result;
  }

 private:
  [[nodiscard]] Eigen::Vector3d Moved(std::size_t i) const {
    const Eigen::Vector3d p = reference_.points[i].cast<double>();
    const Follower& follower = followers_[i];
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < kNodesOfSample; ++k) {
      if (follower.weight[k] > 0) moved += follower.weight[k] * nodes_[follower.node[k]].Moved(p);
    }
    return moved;
  }

  [[nodiscard]] Eigen::Vector3d TurnedNormal(std::size_t i) const {
    Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
    for (std::size_t k = 0; k < kNodesOfSample; ++k)
      R += followers_[i].weight[k] * nodes_[followers_[i].node[k]].R;
    return (R * reference_.normals[i].cast<double>()).normalized();
  }

  void FindMatches(const NearestSample& nearest, const DeformationStage& stage) {
    matches_.assign(reference_.size(), Match());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, reference_.size(), 256),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        for (std::size_t i = range.begin(); i < range.end(); ++i)
                          matches_[i] = MatchOf(i, nearest, stage);
                      });
  }

  [[nodiscard]] Match MatchOf(std::size_t i, const NearestSample& nearest,
                              const DeformationStage& stage) const {
    if (reference_.inner[i] == 0) return {};
    const Eigen::Vector3d p = Moved(i);
    const std::uint32_t j = nearest.Find(p.cast<float>());
    if (j == NearestSample::kNone || current_.inner[j] == 0) return {};
    const Eigen::Vector3d normal = current_.normals[j].cast<double>();
    if (TurnedNormal(i).dot(normal) < stage.min_normal_cos) return {};
    Match match;
    match.normal = normal;
    match.residual_m = normal.dot(p - current_.points[j].cast<double>());
    match.weight = TukeyWeight(match.residual_m / (kTukeyCut * stage.scale_m));
    return match;
  }

  bool Step(const DeformationStage& stage) {
    equations_.Clear();
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (matches_[i].weight > 0) AddSample(i);
    }
    for (const auto& [a, b] : edges_) {
      AddEdge(a, b, stage.edge_sigma_m);
      AddEdge(b, a, stage.edge_sigma_m);
    }
    AddPrior();
    const std::optional<Eigen::VectorXd> step = equations_.Solve();
    if (!step) return false;
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const Vector6d part = step->segment<6>(static_cast<Eigen::Index>(6 * k));
      nodes_[k].R = RotationFromVector(part.head<3>()) * nodes_[k].R;
      nodes_[k].shift_m += part.tail<3>();
    }
    return true;
  }

  void AddSample(std::size_t i) {
    const Match& match = matches_[i];
    const Follower& follower = followers_[i];
    const Eigen::Vector3d p = reference_.points[i].cast<double>();
    const double information = match.weight / (kSigmaOfSample_m * kSigmaOfSample_m);
    std::array<Vector6d, kNodesOfSample> gradient;
    for (std::size_t k = 0; k < kNodesOfSample; ++k) {
      const Node& node = nodes_[follower.node[k]];
      gradient[k] << (node.R * (p - node.place_m)).cross(match.normal), match.normal;
      gradient[k] *= follower.weight[k];
    }
    for (std::size_t a = 0; a < kNodesOfSample; ++a) {
      if (!(follower.weight[a] > 0)) continue;
      equations_.AddRight(follower.node[a], -information * match.residual_m * gradient[a]);
      for (std::size_t b = 0; b < kNodesOfSample; ++b) {
        if (follower.weight[b] > 0)
          equations_.Add(follower.node[a], follower.node[b],
                         information * gradient[a] * gradient[b].transpose());
      }
    }
  }

  // Expected position of neighbour b according to node a, minus its actual position.
  void AddEdge(std::size_t a, std::size_t b, double sigma_m) {
    const Node &from = nodes_[a], &to = nodes_[b];
    const Eigen::Vector3d arm = from.R * (to.place_m - from.place_m);
    const Eigen::Vector3d error = arm + from.place_m + from.shift_m - to.place_m - to.shift_m;
    const double information = 1.0 / (sigma_m * sigma_m + kRelease * error.squaredNorm());
    const Matrix3x6d of_a = PointJacobian(arm);
    Matrix3x6d of_b;
    of_b << Eigen::Matrix3d::Zero(), -Eigen::Matrix3d::Identity();
    equations_.AddRight(a, -information * of_a.transpose() * error);
    equations_.AddRight(b, -information * of_b.transpose() * error);
    equations_.Add(a, a, information * of_a.transpose() * of_a);
    equations_.Add(b, b, information * of_b.transpose() * of_b);
    equations_.Add(a, b, information * of_a.transpose() * of_b);
    equations_.Add(b, a, information * of_b.transpose() * of_a);
  }

  void AddPrior() {
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      const double shift_information =
          1.0 / (kSigmaOfShift_m * kSigmaOfShift_m + kRelease * nodes_[k].shift_m.squaredNorm());
      Vector6d information, state;
      information << Eigen::Vector3d::Constant(1.0 / (kSigmaOfTurn_rad * kSigmaOfTurn_rad)),
          Eigen::Vector3d::Constant(shift_information);
      state << VectorFromRotation(nodes_[k].R), nodes_[k].shift_m;
      equations_.Add(k, k, information.asDiagonal());
      equations_.AddRight(k, -information.cwiseProduct(state));
    }
  }

  Surface reference_;
  Surface current_;  // moved back by the rigid motion
  std::vector<Node> nodes_;
  std::vector<Follower> followers_;
  std::vector<Match> matches_;
  NodeEquations equations_;
  std::vector<std::pair<std::size_t, std::size_t>> edges_;
};

}  // namespace

std::optional<Deformation> EstimateDeformation(const DeformationInput& input) {
  Surface reference = BodySurface(input.reference_cloud, input.reference_body);
  Surface current = MovedBack(BodySurface(input.current_cloud, input.current_body), input.T_motion);
  if (reference.size() < kMinSurfaceSamples || current.size() < kMinSurfaceSamples)
    return std::nullopt;
  Registration registration(std::move(reference), std::move(current));
  for (const DeformationStage& stage : kStages) registration.Descend(stage, input.stop);
  return registration.Result();
}

}  // namespace plumb
