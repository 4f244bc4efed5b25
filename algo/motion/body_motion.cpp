// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/body_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "algo/base/check_stop.hpp"
#include "algo/base/robust_weights.hpp"
#include "algo/base/statistics.hpp"
#include "algo/motion/motion_start.hpp"
#include "algo/motion/surface.hpp"

namespace plumb {
namespace {

constexpr int kMinPairs = 30;
// pairs summed together; a fixed number, so that sums do not depend on the number of threads
constexpr std::size_t kChunk = 1024;
constexpr double kMadToSigma = 1.4826;
constexpr double kMinScale_m =
    0.2e-3;  // below the noise of any sensor; keeps the scale of perfect data above zero
// Area within which residuals are strongly correlated and count as one measurement. Half and double
// of it state 0.114 and 0.131 mm.
constexpr double kCorrelationArea_m2 = 1e-4;
// Block size for the empirical covariance. On sim-a 0.04 m states 0.098 mm and 0.16 m 0.132 mm for
// the surfaces' part instead of 0.120 mm: much smaller blocks count errors that neighbours share as
// independent ones.
constexpr double kBlock_m = 0.08;
constexpr double kMinInformation =
    1e-6;  // eigenvalue relative to the largest; a direction below it counts as unobserved
constexpr double kStepTolerance_m = 5e-6;
constexpr double kSeenInformation =
    3e-4;  // eigenvalue relative to the largest; a direction below it keeps its start value

// One side of the registration.
struct Side {
  Surface surface;
  NearestSample nearest;
  Side(Surface s, double radius_m) : surface(std::move(s)), nearest(surface.points, radius_m) {}
};

struct MotionStage {
  double spacing_m;       // of the samples
  double smoothing_m;     // radius over which their normals are fitted
  double radius_m;        // search radius for correspondences
  double max_sideways_m;  // largest distance of a correspondence along the surface
  double min_normal_cos;
  double max_scale_m;  // upper limit of the residuals' scale, which bounds the reach of the weights
  int max_iterations;
  double limit_m;  // what a sample without correspondence counts as, when starts are compared
};

// Both only bring the fine stage within its reach. Measured on the two scans of sim-a: with the
// radii, distances and scales of either stage halved or doubled, with cosines from half to 0.9, and
// with half of the iterations, the motion stays within 0.0001 mm and 0.00001 deg.
constexpr MotionStage kCoarse = {.spacing_m = 0.02,
                                 .smoothing_m = 0.06,
                                 .radius_m = 0.08,
                                 .max_sideways_m = 0.03,
                                 .min_normal_cos = 0.6,
                                 .max_scale_m = 0.03,
                                 .max_iterations = 15,
                                 .limit_m = 0.02};
constexpr MotionStage kMiddle = {.spacing_m = 0.01,
                                 .smoothing_m = 0.025,
                                 .radius_m = 0.03,
                                 .max_sideways_m = 0.015,
                                 .min_normal_cos = 0.7,
                                 .max_scale_m = 0.008,
                                 .max_iterations = 15,
                                 .limit_m = 0.015};
// Starts that ended this near to each other count as one; that many different ones are refined.
// On sim-a a single one, and half and double of these two and of the limits, give the same bits:
// its body has one place. More are for bodies that fit nearly as well when turned.
constexpr double kSameEnd_rad = 0.03;
constexpr double kSameEnd_m = 0.01;
constexpr std::size_t kMaxDistinct = 3;

constexpr double kFineSpacing_m = 0.005;
constexpr double kMaxFineSamples =
    20000.0;  // samples of one body; more would cost time without adding independent information

// A correspondence is at most two sample spacings away: surfaces that are farther apart do not
// belong to the rigid part, and the search stays short. Measured on sim-a: three quarters of the
// radius and half of the distance along the surface move the result by 0.008 mm and leave 78 % of
// the samples instead of 88 % with a correspondence, double of both 0.002 mm; cosines of 0.4 and
// 0.9 0.0002 mm; half and double of the smoothing 0.007 mm; half of the iterations, half and double
// of the largest scale nothing.
MotionStage FineStage(double spacing_m) {
  return {.spacing_m = spacing_m,
          .smoothing_m = 3 * spacing_m,
          .radius_m = 2 * spacing_m,
          .max_sideways_m = 1.2 * spacing_m,
          .min_normal_cos = 0.8,
          .max_scale_m = spacing_m,
          .max_iterations = 25,
          .limit_m = 0.0};  // no starts are compared
}

// Least slope of the weights' influence in the covariance: residuals in the weights' descending
// part would take more information away than the others can give. On sim-a -0.15 and -0.6 state
// 0.117 and 0.123 mm for the surfaces' part instead of 0.120 mm.
constexpr double kLeastSlope = -0.3;

struct Pair {
  Eigen::Vector3d arm = Eigen::Vector3d::Zero();  // moved point from the pivot
  Eigen::Vector3d normal_reference = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal_current = Eigen::Vector3d::Zero();
  double residual_m = 0.0;  // along the mean normal, moved reference minus current
  bool valid = false;
};

Vector6d Gradient(const Eigen::Vector3d& arm, const Eigen::Vector3d& normal) {
  Vector6d gradient;
  gradient << arm.cross(normal), normal;
  return gradient;
}

Pair MakePair(const Surface& reference, std::size_t i, const Surface& current, std::size_t j,
              const Pose& T, const Eigen::Vector3d& pivot, const MotionStage& stage) {
  Pair pair;
  const Eigen::Vector3d p = T * reference.points[i].cast<double>();
  const Eigen::Vector3d q = current.points[j].cast<double>();
  pair.normal_reference = T.linear() * reference.normals[i].cast<double>();
  pair.normal_current = current.normals[j].cast<double>();
  if (pair.normal_reference.dot(pair.normal_current) < stage.min_normal_cos) return pair;
  const Eigen::Vector3d normal = (pair.normal_reference + pair.normal_current).normalized();
  const Eigen::Vector3d difference = p - q;
  pair.residual_m = normal.dot(difference);
  pair.arm = p - pivot;
  pair.valid = (difference - pair.residual_m * normal).norm() < stage.max_sideways_m;
  return pair;
}

// Correspondences from both sides, one slot each: the reference's samples first, then the current
// ones.
std::vector<Pair> FindPairs(const Side& reference, const Side& current, const Pose& T,
                            const Eigen::Vector3d& pivot, const MotionStage& stage) {
  const std::size_t n = reference.surface.size();
  const std::size_t m = current.surface.size();
  std::vector<Pair> pairs(n + m);
  const Pose T_back = T.inverse();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, n + m, 512),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t k = range.begin(); k < range.end(); ++k) {
          const bool forward = k < n;
          const Side& from = forward ? reference : current;
          const Side& to = forward ? current : reference;
          const std::size_t i = forward ? k : k - n;
          if (from.surface.inner[i] == 0) continue;
          const Eigen::Vector3d p = from.surface.points[i].cast<double>();
          const Eigen::Vector3d moved = forward ? T * p : T_back * p;
          const std::uint32_t match = to.nearest.Find(moved.cast<float>());
          if (match == NearestSample::kNone || to.surface.inner[match] == 0) continue;
          pairs[k] = forward
                         ? MakePair(reference.surface, i, current.surface, match, T, pivot, stage)
                         : MakePair(reference.surface, match, current.surface, i, T, pivot, stage);
        }
      });
  return pairs;
}

// Robust standard deviation of the valid residuals, or nothing if there are too few.
std::optional<double> ResidualScale(const std::vector<Pair>& pairs, double max_scale_m) {
  std::vector<double> magnitudes;
  for (const Pair& pair : pairs) {
    if (pair.valid) magnitudes.push_back(std::abs(pair.residual_m));
  }
  if (magnitudes.size() < static_cast<std::size_t>(kMinPairs)) return std::nullopt;
  return std::clamp(kMadToSigma * TakeMedian(magnitudes), kMinScale_m, max_scale_m);
}

double WeightOf(double residual_m, double scale_m) {
  return TukeyWeight(residual_m / (kTukeyCut * scale_m));
}

struct MotionEquations {
  Matrix6d A = Matrix6d::Zero();
  // A computed with one normal from each side, so that the noise of the normals does not bias it
  Matrix6d crossed = Matrix6d::Zero();
  Vector6d b = Vector6d::Zero();
};

MotionEquations SumPairs(const std::vector<Pair>& pairs, double scale_m) {
  const std::size_t num_chunks = (pairs.size() + kChunk - 1) / kChunk;
  std::vector<MotionEquations> sums(num_chunks);
  tbb::parallel_for(std::size_t{0}, num_chunks, [&](std::size_t c) {
    MotionEquations& sum = sums[c];
    for (std::size_t k = c * kChunk; k < std::min(pairs.size(), (c + 1) * kChunk); ++k) {
      const Pair& pair = pairs[k];
      const double w = pair.valid ? WeightOf(pair.residual_m, scale_m) : 0.0;
      if (w == 0.0) continue;
      const Vector6d gradient =
          Gradient(pair.arm, (pair.normal_reference + pair.normal_current).normalized());
      sum.A += w * gradient * gradient.transpose();
      sum.crossed += w * Gradient(pair.arm, pair.normal_reference) *
                     Gradient(pair.arm, pair.normal_current).transpose();
      sum.b += w * pair.residual_m * gradient;
    }
  });
  MotionEquations total;
  for (const MotionEquations& sum : sums) {
    total.A += sum.A;
    total.crossed += 0.5 * (sum.crossed + sum.crossed.transpose());
    total.b += sum.b;
  }
  return total;
}

// Gauss-Newton step within the directions that the surfaces determine. Along a direction that they
// do not determine (the roll of a cylinder), the noise of the normals would drive the pose away.
// `unit` scales the unknowns to comparable size.
Vector6d StepInObservableSubspace(const MotionEquations& equations, const Vector6d& unit) {
  const Matrix6d A = unit.asDiagonal() * equations.A * unit.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(unit.asDiagonal() * equations.crossed *
                                                      unit.asDiagonal());
  int unseen = 0;
  while (unseen < 6 && eigen.eigenvalues()[unseen] < kSeenInformation * eigen.eigenvalues()[5])
    ++unseen;
  const Eigen::MatrixXd seen = eigen.eigenvectors().rightCols(6 - unseen);
  const Eigen::VectorXd along = (seen.transpose() * A * seen)
                                    .ldlt()
                                    .solve(-(seen.transpose() * (unit.asDiagonal() * equations.b)));
  return unit.asDiagonal() * (seen * along);
}

struct StageResult {
  Pose T = Pose::Identity();
  double scale_m = 0.0;
  int iterations = 0;
  bool valid = false;
};

Eigen::Vector3d MeanPoint(const Surface& surface) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : surface.points) sum += p.cast<double>();
  return sum / static_cast<double>(std::max<std::size_t>(surface.size(), 1));
}

// Root mean square distance from the centroid: converts radians into metres of comparable size.
double LeverArm(const Surface& surface, const Eigen::Vector3d& centroid) {
  double sum = 0.0;
  for (const Eigen::Vector3f& p : surface.points)
    sum += (p.cast<double>() - centroid).squaredNorm();
  return std::max(std::sqrt(sum / static_cast<double>(std::max<std::size_t>(surface.size(), 1))),
                  1e-3);
}

StageResult RunStage(const Side& reference, const Side& current, const Pose& T_start,
                     const MotionStage& stage, const std::stop_token& stop) {
  StageResult result;
  result.T = T_start;
  const Eigen::Vector3d centroid = MeanPoint(reference.surface);
  const double lever = LeverArm(reference.surface, centroid);
  for (; result.iterations < stage.max_iterations; ++result.iterations) {
    CheckStop(stop);
    const Eigen::Vector3d pivot = result.T * centroid;
    const std::vector<Pair> pairs = FindPairs(reference, current, result.T, pivot, stage);
    const std::optional<double> scale = ResidualScale(pairs, stage.max_scale_m);
    result.valid = scale.has_value();
    if (!scale) return result;
    result.scale_m = *scale;
    // In units of the lever arm, rotation and translation have equal weight.
    Vector6d unit;
    unit << Eigen::Vector3d::Constant(1.0 / lever), Eigen::Vector3d::Ones();
    const Vector6d twist = StepInObservableSubspace(SumPairs(pairs, *scale), unit);
    if (!twist.allFinite()) {
      result.valid = false;
      return result;
    }
    result.T = Orthonormalised(PoseAbout(pivot, twist) * result.T);
    if (twist.cwiseQuotient(unit).norm() < kStepTolerance_m) break;
  }
  return result;
}

Side SideOf(const PointCloud& cloud, const MotionStage& stage) {
  return {MakeSurface(cloud, stage.spacing_m, stage.smoothing_m), stage.radius_m};
}

// Two-sided mean of distances up to the stage's limit, metres.
double Disagreement(const Side& reference, const Side& current, const Pose& T,
                    const MotionStage& stage) {
  const std::vector<Pair> pairs = FindPairs(reference, current, T, Eigen::Vector3d::Zero(), stage);
  const auto mean = [&](const Surface& surface, std::size_t first) {
    double sum = 0.0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < surface.size(); ++i) {
      if (surface.inner[i] == 0) continue;
      const Pair& pair = pairs[first + i];
      sum += pair.valid ? std::min(std::abs(pair.residual_m), stage.limit_m) : stage.limit_m;
      ++count;
    }
    return count > 0 ? sum / static_cast<double>(count) : stage.limit_m;
  };
  return 0.5 * (mean(reference.surface, 0) + mean(current.surface, reference.surface.size()));
}

PointCloud BodyCloud(const PointCloud& cloud, const Body& body) {
  PointCloud part;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!body.Contains(cloud.points[i].cast<double>())) continue;
    part.points.push_back(cloud.points[i]);
    part.normals.push_back(cloud.normals[i]);
  }
  return part;
}

// Best of the starts after coarse, then middle refinement of the three most promising.
std::optional<Pose> GlobalMotion(const BodyMotionInput& input, const PointCloud& reference,
                                 const PointCloud& current) {
  const Side coarse_reference = SideOf(reference, kCoarse);
  const Side coarse_current = SideOf(current, kCoarse);
  struct Scored {
    Pose T;
    double score;
  };
  const auto by_score = [](const Scored& a, const Scored& b) { return a.score < b.score; };
  std::vector<Scored> scored;
  std::vector<Pose> starts = MotionStarts(input.reference_body, input.current_body);
  starts.insert(starts.end(), input.starts.begin(), input.starts.end());
  for (const Pose& start : starts) {
    const StageResult refined =
        RunStage(coarse_reference, coarse_current, start, kCoarse, input.stop);
    if (refined.valid)
      scored.push_back(
          {refined.T, Disagreement(coarse_reference, coarse_current, refined.T, kCoarse)});
  }
  if (scored.empty()) return std::nullopt;
  std::stable_sort(scored.begin(), scored.end(), by_score);
  // Starts that converged to the same pose are refined once.
  std::vector<Scored> distinct;
  for (const Scored& s : scored) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Scored& d) {
      const Eigen::Vector3d c = input.region_centroid_m;
      return RotationAngle(s.T.inverse() * d.T) < kSameEnd_rad &&
             (s.T * c - d.T * c).norm() < kSameEnd_m;
    });
    if (!known && distinct.size() < kMaxDistinct) distinct.push_back(s);
  }
  const Side middle_reference = SideOf(reference, kMiddle);
  const Side middle_current = SideOf(current, kMiddle);
  for (Scored& s : distinct) {
    const StageResult refined =
        RunStage(middle_reference, middle_current, s.T, kMiddle, input.stop);
    if (refined.valid) s.T = refined.T;
    s.score = Disagreement(middle_reference, middle_current, s.T, kMiddle);
  }
  return std::min_element(distinct.begin(), distinct.end(), by_score)->T;
}

// Covariance of the converged fit: A^-1 B A^-1 with B from blocks, plus the contribution of
// independent small patches.
Matrix6d FitCovariance(const std::vector<Pair>& pairs, double scale_m, double spacing_m,
                       double lever) {
  Matrix6d information = Matrix6d::Zero();
  std::map<std::array<int, 3>, Vector6d> blocks;
  Vector6d unit;
  unit << Eigen::Vector3d::Constant(1.0 / lever), Eigen::Vector3d::Ones();
  for (const Pair& pair : pairs) {
    const double u = pair.residual_m / (kTukeyCut * scale_m);
    if (!pair.valid || std::abs(u) >= 1.0) continue;
    const Vector6d a = unit.asDiagonal() * Gradient(pair.arm, pair.normal_reference);
    const Vector6d b = unit.asDiagonal() * Gradient(pair.arm, pair.normal_current);
    const double slope = std::max((1 - u * u) * (1 - 5 * u * u), kLeastSlope);
    information += 0.5 * slope * (a * b.transpose() + b * a.transpose());
    const Eigen::Array3i block = (pair.arm.array() / kBlock_m).floor().cast<int>();
    const auto slot = blocks.try_emplace({block[0], block[1], block[2]}, Vector6d::Zero()).first;
    slot->second += WeightOf(pair.residual_m, scale_m) * pair.residual_m * 0.5 * (a + b);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(information);
  const double largest = std::max(eigen.eigenvalues()[5], 1e-12);
  const Matrix6d inverse =
      eigen.eigenvectors() *
      eigen.eigenvalues().cwiseMax(kMinInformation * largest).cwiseInverse().asDiagonal() *
      eigen.eigenvectors().transpose();
  Matrix6d scatter = Matrix6d::Zero();
  for (const auto& [block, sum] : blocks) scatter += sum * sum.transpose();
  const double k = static_cast<double>(blocks.size());
  scatter *= k / std::max(k - 6.0, 1.0);
  // Each sample gives two correspondences (one from each side), and each kCorrelationArea_m2 gives
  // one independent measurement.
  const double pairs_per_measurement =
      2.0 * std::max(kCorrelationArea_m2 / (spacing_m * spacing_m), 1.0);
  const Matrix6d small_patches = scale_m * scale_m * pairs_per_measurement * inverse;
  const Matrix6d covariance = inverse * scatter * inverse + small_patches;
  return unit.asDiagonal() * covariance * unit.asDiagonal();
}

}  // namespace

std::optional<SurfaceMotion> EstimateBodyMotion(const BodyMotionInput& input) {
  const PointCloud reference = BodyCloud(input.reference_cloud, input.reference_body);
  const PointCloud current = BodyCloud(input.current_cloud, input.current_body);
  if (reference.size() < kMinSurfaceSamples || current.size() < kMinSurfaceSamples)
    return std::nullopt;
  const std::optional<Pose> T_start = GlobalMotion(input, reference, current);
  if (!T_start) return std::nullopt;

  MotionStage stage = FineStage(kFineSpacing_m);
  Surface fine_reference = MakeSurface(reference, stage.spacing_m, stage.smoothing_m);
  if (static_cast<double>(fine_reference.size()) > kMaxFineSamples) {
    stage = FineStage(stage.spacing_m *
                      std::sqrt(static_cast<double>(fine_reference.size()) / kMaxFineSamples));
    fine_reference = MakeSurface(reference, stage.spacing_m, stage.smoothing_m);
  }
  if (input.in_region) {
    fine_reference = Subset(fine_reference, [&](std::size_t i) {
      return input.in_region(fine_reference.points[i].cast<double>());
    });
  }
  if (fine_reference.size() < kMinSurfaceSamples) return std::nullopt;
  const Side side_reference(std::move(fine_reference), stage.radius_m);
  const Side side_current = SideOf(current, stage);
  const StageResult fitted = RunStage(side_reference, side_current, *T_start, stage, input.stop);
  if (!fitted.valid) return std::nullopt;

  SurfaceMotion motion;
  motion.T = fitted.T;
  motion.scale_m = fitted.scale_m;
  motion.iterations = fitted.iterations;
  const Eigen::Vector3d pivot = motion.T * input.region_centroid_m;
  const std::vector<Pair> pairs = FindPairs(side_reference, side_current, motion.T, pivot, stage);
  motion.covariance = FitCovariance(pairs, fitted.scale_m, stage.spacing_m,
                                    LeverArm(side_reference.surface, input.region_centroid_m));
  std::size_t inner = 0;
  std::size_t explained = 0;
  for (std::size_t i = 0; i < side_reference.surface.size(); ++i) {
    if (side_reference.surface.inner[i] == 0) continue;
    ++inner;
    explained += pairs[i].valid && WeightOf(pairs[i].residual_m, fitted.scale_m) > 0 ? 1 : 0;
  }
  motion.inlier_fraction =
      inner > 0 ? static_cast<double>(explained) / static_cast<double>(inner) : 0.0;
  return motion;
}

}  // namespace plumb
