// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/scene_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "algo/base/statistics.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "words/comparison.hpp"

namespace plumb {
namespace {

// No map knows a corner better than this, whatever its stated uncertainty: prints are flat and cut
// only to some tenths of a millimetre.
constexpr double kMinCornerSigma_m = 0.2 * kMillimetre;
// The four corners of a marker share the error of the views that placed it, so together they count
// as two independent points.
constexpr double kIndependentFraction = 0.5;
// The stated sigmas count as much as so many observed values that agree with them.
constexpr double kStatedSigmasCount = 12.0;
// Difference of scale between two scans of one room: 0.03 to 0.25 % measured on simulated sweeps.
constexpr double kStretchSigma = 0.002;
// a larger difference is not a scale error but a different room
constexpr double kMaxStretch = 0.02;
// limits the pairs that are tried: 1770 fits of 8 points
constexpr std::size_t kMaxHypothesisMarkers = 60;

// A marker that both scenes contain.
struct SharedMarker {
  int id = 0;
  MarkerCorners reference;
  MarkerCorners current;
  double sigma_m = 0.0;  // standard deviation of one coordinate of the difference
};

using Subset = std::vector<std::size_t>;  // indices of shared markers, ascending

bool AllFinite(const MarkerCorners& corners) {
  return std::all_of(corners.begin(), corners.end(),
                     [](const Eigen::Vector3d& p) { return p.allFinite(); });
}

double SquaredSigma(const SceneMarker& marker) {
  const double sigma =
      std::isfinite(marker.sigma_m) ? std::max(marker.sigma_m, kMinCornerSigma_m) : 1.0;
  return sigma * sigma;
}

std::vector<SharedMarker> SharedMarkers(const MarkerMap& reference, const MarkerMap& current) {
  std::vector<SharedMarker> shared;
  for (const auto& [id, marker] : reference) {
    const auto other = current.find(id);
    if (other == current.end() || !AllFinite(marker.corners) || !AllFinite(other->second.corners))
      continue;
    shared.push_back({id, marker.corners, other->second.corners,
                      std::sqrt(SquaredSigma(marker) + SquaredSigma(other->second))});
  }
  return shared;
}

RigidFit FitSubset(std::span<const SharedMarker> shared, const Subset& subset, bool weighted) {
  std::vector<Eigen::Vector3d> points_reference, points_current;
  std::vector<double> weights;
  for (const std::size_t i : subset) {
    for (std::size_t corner = 0; corner < 4; ++corner) {
      points_reference.push_back(shared[i].reference[corner]);
      points_current.push_back(shared[i].current[corner]);
      weights.push_back(weighted ? 1.0 / (shared[i].sigma_m * shared[i].sigma_m) : 1.0);
    }
  }
  return FitRigid(points_reference, points_current, weights);
}

// Root mean square corner distance of one marker under an alignment.
double MarkerResidual(const SharedMarker& marker, const Pose& T_reference_current) {
  return CornerDistance(marker.reference, T_reference_current, marker.current);
}

// Weighted as in the fit: the point about which its rotation and translation are uncorrelated.
Eigen::Vector3d WeightedCentre(std::span<const SharedMarker> shared, const Subset& subset) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double total = 0.0;
  for (const std::size_t i : subset) {
    const double w = 1.0 / (shared[i].sigma_m * shared[i].sigma_m);
    centre += w * CentreOf(shared[i].reference);
    total += w;
  }
  return centre / total;
}

// Covariance of the weighted fit: left perturbation (rotation vector, translation) about `centre`.
Matrix6d FitCovariance(std::span<const SharedMarker> shared, const Subset& subset,
                       const Eigen::Vector3d& centre) {
  Matrix6d information = Matrix6d::Zero();
  for (const std::size_t i : subset) {
    for (const Eigen::Vector3d& corner : shared[i].reference) {
      const Matrix3x6d jacobian = PointJacobian(corner - centre);
      information += kIndependentFraction / (shared[i].sigma_m * shared[i].sigma_m) *
                     jacobian.transpose() * jacobian;
    }
  }
  return information.ldlt().solve(Matrix6d::Identity());
}

// By how much the variances of a fit's markers differ from the stated ones, which are right on
// average only: errors that one unit repeats in both scans do not show between them, and some
// sweeps err more than others. The observed disagreement of the corners replaces the stated
// variances: at once where it is larger, and where it is smaller to the extent that enough corners
// show it.
double VarianceFactor(std::span<const SharedMarker> shared, const Subset& subset, const Pose& T) {
  double chi2 = 0.0;
  for (const std::size_t i : subset) {
    const double residual = MarkerResidual(shared[i], T);
    chi2 += 4.0 * residual * residual / (shared[i].sigma_m * shared[i].sigma_m);
  }
  // The fit has six degrees of freedom; each corner contributes three coordinates.
  const double degrees_of_freedom = 12.0 * static_cast<double>(subset.size()) - 6.0;
  return std::max(chi2 / degrees_of_freedom,
                  (kStatedSigmasCount + chi2) / (kStatedSigmasCount + degrees_of_freedom));
}

// Standard deviation of MarkerResidual() for a marker that did not move and was not in the fit.
double ExpectedResidual(const SharedMarker& marker, const Matrix6d& fit_covariance,
                        const Eigen::Vector3d& centre) {
  double variance = 0.0;
  for (const Eigen::Vector3d& corner : marker.reference) {
    const Matrix3x6d jacobian = PointJacobian(corner - centre);
    variance += (jacobian * fit_covariance * jacobian.transpose()).trace() / 4.0;
  }
  return std::sqrt(variance + 3.0 * marker.sigma_m * marker.sigma_m);
}

// The markers that agree with a hypothesis, judged only by their own noise.
Subset Supporters(std::span<const SharedMarker> shared, const Pose& T,
                  const MarkerConsensusOptions& options) {
  Subset subset;
  for (std::size_t i = 0; i < shared.size(); ++i) {
    const double limit =
        std::max(options.moved_m, options.moved_sigmas * std::sqrt(3.0) * shared[i].sigma_m);
    if (MarkerResidual(shared[i], T) <= limit) subset.push_back(i);
  }
  return subset;
}

struct Consensus {
  Subset subset;
  double rms_m = 0.0;
};

bool Disjoint(const Subset& a, const Subset& b) {
  return std::none_of(a.begin(), a.end(),
                      [&](std::size_t i) { return std::binary_search(b.begin(), b.end(), i); });
}

// Largest sets of markers that one rigid transform explains, best first. Hypotheses come from all
// markers together and from every pair of them, because one marker alone extrapolates too badly.
std::vector<Consensus> ConsensusSets(std::span<const SharedMarker> shared,
                                     const MarkerConsensusOptions& options) {
  std::vector<Consensus> sets;
  const auto consider = [&](const Subset& seed) {
    RigidFit fit = FitSubset(shared, seed, true);
    Subset subset = seed;
    bool settled = false;  // the set reproduces itself; otherwise it is not a consensus
    for (int round = 0; round < 10 && fit.valid && !settled; ++round) {
      Subset next = Supporters(shared, fit.T_a_b, options);
      settled = next == subset;
      subset = std::move(next);
      fit = FitSubset(shared, subset, true);
    }
    if (!settled || !fit.valid || std::any_of(sets.begin(), sets.end(), [&](const Consensus& c) {
          return c.subset == subset;
        }))
      return;
    sets.push_back({subset, fit.rms_m});
  };
  Subset all;
  for (std::size_t i = 0; i < shared.size(); ++i) all.push_back(i);
  consider(all);
  const std::size_t n = std::min(shared.size(), kMaxHypothesisMarkers);
  const bool everyone_agrees = !sets.empty() && sets.front().subset.size() == shared.size();
  for (std::size_t i = 0; i < n && !everyone_agrees; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) consider({i, j});
  }
  std::stable_sort(sets.begin(), sets.end(), [](const Consensus& a, const Consensus& b) {
    return a.subset.size() != b.subset.size() ? a.subset.size() > b.subset.size()
                                              : a.rms_m < b.rms_m;
  });
  return sets;
}

struct LeaveOneOut {
  double residual_m = 0.0;
  double excess = 0.0;  // Residual over the limit; above 1 the marker has moved.
};

// Judges a marker by the fit of the other markers in `good`.
LeaveOneOut JudgeMarker(std::span<const SharedMarker> shared, const Subset& good, std::size_t index,
                        const MarkerConsensusOptions& options) {
  Subset others;
  std::copy_if(good.begin(), good.end(), std::back_inserter(others),
               [&](std::size_t i) { return i != index; });
  LeaveOneOut judged;
  if (others.empty()) return judged;
  const RigidFit fit = FitSubset(shared, others, true);
  if (!fit.valid) return judged;
  const Eigen::Vector3d centre = WeightedCentre(shared, others);
  // Scaled by the scatter of the other markers: the stated sigmas alone would let a marker move by
  // a centimetre unnoticed.
  const double sigma =
      std::sqrt(VarianceFactor(shared, others, fit.T_a_b)) *
      ExpectedResidual(shared[index], FitCovariance(shared, others, centre), centre);
  judged.residual_m = MarkerResidual(shared[index], fit.T_a_b);
  judged.excess = judged.residual_m / std::max(options.moved_m, options.moved_sigmas * sigma);
  return judged;
}

// Rejects the marker with the largest excess while any is above its limit, then readmits the
// markers that agree with the rest.
Subset GoodMarkers(std::span<const SharedMarker> shared, Subset good,
                   const MarkerConsensusOptions& options) {
  while (good.size() > 2) {
    std::size_t worst = 0;
    double worst_excess = 0.0;
    for (std::size_t k = 0; k < good.size(); ++k) {
      const double excess = JudgeMarker(shared, good, good[k], options).excess;
      if (excess > worst_excess) {
        worst_excess = excess;
        worst = k;
      }
    }
    if (worst_excess <= 1.0) break;
    good.erase(good.begin() + static_cast<std::ptrdiff_t>(worst));
  }
  if (good.size() < 3) return good;
  Subset agreeing = good;
  for (std::size_t i = 0; i < shared.size(); ++i) {
    if (std::binary_search(good.begin(), good.end(), i)) continue;
    if (JudgeMarker(shared, good, i, options).excess <= 1.0) agreeing.push_back(i);
  }
  std::sort(agreeing.begin(), agreeing.end());
  return agreeing;
}

// How much each marker says of the maps' distortion: one that was seen worse than most says how it
// was seen. (A marker with a sigma of 13 mm, beside others with 0.3, made the distortion of a map
// 1.5 instead of 0.5 mm.)
std::vector<double> DistortionWeights(std::span<const SharedMarker> shared, const Subset& subset) {
  std::vector<double> sigmas_m;
  for (const std::size_t i : subset) sigmas_m.push_back(shared[i].sigma_m);
  const double usual_m = TakeMedian(sigmas_m);
  std::vector<double> weights;
  for (const std::size_t i : subset) {
    const double ratio = std::min(1.0, usual_m / shared[i].sigma_m);
    weights.push_back(ratio * ratio);
  }
  return weights;
}

Alignment MakeAlignment(std::span<const SharedMarker> shared, const Subset& subset,
                        const RigidFit& fit) {
  Alignment alignment;
  alignment.T_reference_current = fit.T_a_b;
  alignment.centre_m = WeightedCentre(shared, subset);
  const auto count = static_cast<double>(subset.size());
  double sum = 0.0;
  double spread = 0.0;
  const std::vector<double> weights = DistortionWeights(shared, subset);
  for (std::size_t k = 0; k < subset.size(); ++k) {
    const std::size_t i = subset[k];
    const double residual = MarkerResidual(shared[i], fit.T_a_b);
    sum += residual * residual;
    spread += (CentreOf(shared[i].reference) - alignment.centre_m).squaredNorm();
    const Eigen::Vector3d off =
        CentreOf(shared[i].reference) - fit.T_a_b * CentreOf(shared[i].current);
    alignment.distortion += weights[k] * off * off.transpose();
    alignment.markers_used.push_back(shared[i].id);
  }
  alignment.rms_m = std::sqrt(sum / count);
  alignment.spread_m = std::sqrt(spread / count);
  // The fit has six degrees of freedom; each marker contributes three coordinates.
  const double weighed = std::accumulate(weights.begin(), weights.end(), 0.0);
  alignment.distortion *= 3.0 / std::max(3.0 * weighed - 6.0, 3.0);
  alignment.covariance =
      VarianceFactor(shared, subset, fit.T_a_b) * FitCovariance(shared, subset, alignment.centre_m);
  return alignment;
}

// Corner pairs of a set of markers relative to its centre, in the axes of their common plane.
struct PlanarCorners {
  // columns; the last one is normal to the plane
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  std::vector<Eigen::Vector3d> reference;
  std::vector<Eigen::Vector3d> current;  // after the rigid fit
  std::vector<double> weights;
};

PlanarCorners InTheirPlane(std::span<const SharedMarker> shared, const Subset& subset,
                           const Alignment& alignment) {
  PlanarCorners corners;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const std::size_t i : subset) {
    for (std::size_t k = 0; k < 4; ++k) {
      corners.reference.push_back(shared[i].reference[k] - alignment.centre_m);
      corners.current.push_back(alignment.T_reference_current * shared[i].current[k] -
                                alignment.centre_m);
      corners.weights.push_back(1.0 / (shared[i].sigma_m * shared[i].sigma_m));
      scatter +=
          corners.weights.back() * corners.reference.back() * corners.reference.back().transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  corners.axes = eigen.eigenvectors().rowwise().reverse();
  for (Eigen::Vector3d& p : corners.reference) p = corners.axes.transpose() * p;
  for (Eigen::Vector3d& p : corners.current) p = corners.axes.transpose() * p;
  return corners;
}

// Alignment::stretch and its sigma: least squares over three values (length, width, shear), each
// with a prior of zero.
void FitStretch(std::span<const SharedMarker> shared, const Subset& subset, Alignment& alignment) {
  const PlanarCorners corners = InTheirPlane(shared, subset, alignment);
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double chi2 = 0.0;
  for (std::size_t k = 0; k < corners.weights.size(); ++k) {
    const Eigen::Vector3d& p = corners.current[k];
    const Eigen::Vector2d difference = (corners.reference[k] - p).head<2>();
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << p.x(), 0, p.y(), 0, p.y(), p.x();
    information += corners.weights[k] * jacobian.transpose() * jacobian;
    right += corners.weights[k] * jacobian.transpose() * difference;
    chi2 += corners.weights[k] * difference.squaredNorm();
  }
  const Eigen::Vector3d best = information.ldlt().solve(right);
  const double degrees_of_freedom =
      std::max(2.0 * static_cast<double>(corners.weights.size()) - 6.0, 1.0);
  const double variance_factor = std::max(1.0, (chi2 - right.dot(best)) / degrees_of_freedom);
  const Eigen::Matrix3d seen = kIndependentFraction / variance_factor * information;
  const Eigen::Matrix3d prior = Eigen::Matrix3d::Identity() / (kStretchSigma * kStretchSigma);
  const Eigen::Matrix3d covariance = (seen + prior).inverse();
  alignment.stretch_sigma = std::sqrt(covariance.diagonal().maxCoeff());
  const Eigen::Vector3d shrunk = covariance * (seen * best);
  if (!shrunk.allFinite() || shrunk.cwiseAbs().maxCoeff() > kMaxStretch) return;
  Eigen::Matrix3d planar = Eigen::Matrix3d::Identity();
  planar.topLeftCorner<2, 2>() << 1 + shrunk[0], shrunk[2], shrunk[2], 1 + shrunk[1];
  alignment.stretch = corners.axes * planar * corners.axes.transpose();
}

// The agreeing markers and the residuals of the others.
struct MarkerConsensus {
  Subset good;
  MarkerEvidence evidence;
};

MarkerConsensus FindConsensus(std::span<const SharedMarker> shared,
                              const MarkerConsensusOptions& options) {
  MarkerConsensus consensus;
  for (const SharedMarker& marker : shared) consensus.evidence.shared_ids.push_back(marker.id);
  const std::vector<Consensus> sets = ConsensusSets(shared, options);
  if (sets.empty()) return consensus;
  consensus.good = GoodMarkers(shared, sets.front().subset, options);
  consensus.evidence.good = static_cast<int>(consensus.good.size());
  consensus.evidence.two_groups =
      std::any_of(sets.begin() + 1, sets.end(), [&](const Consensus& other) {
        return other.subset.size() >= consensus.good.size() &&
               Disjoint(other.subset, consensus.good);
      });
  return consensus;
}

Subset AllOf(std::span<const SharedMarker> shared) {
  Subset all;
  for (std::size_t i = 0; i < shared.size(); ++i) all.push_back(i);
  return all;
}

AlignmentOutcome AlignAll(std::span<const SharedMarker> shared, MarkerConsensus consensus) {
  AlignmentOutcome outcome;
  outcome.markers = std::move(consensus.evidence);
  const Subset all = AllOf(shared);
  for (const std::size_t i : all) {
    if (!std::binary_search(consensus.good.begin(), consensus.good.end(), i)) {
      outcome.markers.moved_used.push_back(shared[i].id);
    }
  }
  const RigidFit fit = FitSubset(shared, all, false);
  if (!fit.valid) return outcome;
  outcome.alignment = MakeAlignment(shared, all, fit);
  outcome.alignment->stretch_sigma = kStretchSigma;
  return outcome;
}

AlignmentOutcome AlignGood(std::span<const SharedMarker> shared, MarkerConsensus consensus,
                           int min_markers) {
  AlignmentOutcome outcome;
  outcome.markers = std::move(consensus.evidence);
  if (!RefusalsOfMarkers(outcome.markers, std::max(min_markers, 1)).empty()) return outcome;
  const RigidFit fit = FitSubset(shared, consensus.good, true);
  if (!fit.valid) return outcome;
  outcome.alignment = MakeAlignment(shared, consensus.good, fit);
  FitStretch(shared, consensus.good, *outcome.alignment);
  for (std::size_t i = 0; i < shared.size(); ++i) {
    if (std::binary_search(consensus.good.begin(), consensus.good.end(), i)) continue;
    const double residual = MarkerResidual(shared[i], fit.T_a_b);
    outcome.alignment->markers_rejected[shared[i].id] = residual;
    outcome.warnings.push_back(say::comparison::MarkerMoved(shared[i].id, residual / kMillimetre));
  }
  if (consensus.good.size() == 3) {
    outcome.warnings.push_back(say::comparison::OnlyThreeMarkers());
  }
  return outcome;
}

}  // namespace

double CornerDistance(const MarkerCorners& to, const Pose& T_to_from, const MarkerCorners& from) {
  double sum = 0.0;
  for (std::size_t corner = 0; corner < to.size(); ++corner)
    sum += (to[corner] - T_to_from * from[corner]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(to.size()));
}

AlignmentOutcome AlignScenes(const MarkerMap& reference, const MarkerMap& current, Preset preset,
                             const MarkerConsensusOptions& options, int min_markers) {
  const std::vector<SharedMarker> shared = SharedMarkers(reference, current);
  MarkerConsensus consensus = FindConsensus(shared, options);
  return preset == Preset::kPaper ? AlignAll(shared, std::move(consensus))
                                  : AlignGood(shared, std::move(consensus), min_markers);
}

}  // namespace plumb
