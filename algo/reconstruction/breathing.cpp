// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/breathing.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <tbb/parallel_for.h>
#include <Eigen/Cholesky>

#include "algo/base/check_stop.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/robust_weights.hpp"
#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/surface/view_fusion.hpp"

namespace plumb {
namespace {

// Patches.
constexpr float kPatch_m = 0.04F;
constexpr std::size_t kPointStride = 32;  // of the cloud; leaves about six points in a patch
// A larger cloud, of a whole room, is thinned more until its patches hold too few points: what is
// to be found is a body, and the time must not grow with the room.
constexpr std::size_t kMaxPoints = 20'000;
constexpr std::size_t kMinPoints = 3;
constexpr float kMinNormalAgreement = 0.8F;  // length of the mean of a patch's unit normals
constexpr float kMaxDistance_m = 0.02F;      // farther away is another surface
constexpr float kMaxDepth_m = 1.8F;          // noise grows with the square of the depth
constexpr float kMinDepth_m = 0.5F;
constexpr float kMinPatchCosIncidence = 0.1F;

// Estimate.
constexpr std::size_t kMinSamples = 6;  // of a patch
constexpr std::size_t kMinViews = 8;
constexpr double kMinDuration_s = 3.0;
constexpr double kLongestPeriod_s = 8.0;
constexpr double kShortestPeriod_s = 2.0;
constexpr int kNumFrequencies = 19;
constexpr int kNumPhases = 16;
constexpr double kMinSpread = 1.5;  // of the cosine over a patch's views; less shows no rhythm
constexpr float kReach_m = 0.08F;   // patches averaged about each patch
constexpr float kSameSide = 0.7F;   // cosine between their normals
constexpr int kMinPatchNeighbours = 4;
constexpr int kFirstSweeps = 6;  // of the alternating fit, before the period is known
constexpr int kSweeps = 4;       // and each time after it
constexpr int kMovementRounds = 2;
constexpr double kCauchySigmas = 3.0;
constexpr double kRidge = 0.02;  // keeps a patch solvable if its views show little of a period
constexpr double kLeastSigma_m = 1e-6;
// Patches move where their slopes are more than this many times the noise, and more than the most
// negative ones, which only errors make.
constexpr double kSignificant = 3.0;
constexpr double kLowestFraction = 0.01;
// A rise counts as surely found from this many times that slope: simulated rises were missed at 2.4
// to 2.8 times it, and found at 4.3 and more.
constexpr double kFoundAbove = 3.0;
constexpr double kMostAffected = 0.9;  // quantile of the moving patches
// Poses and smoothing take part of the movement: of simulated rises of 2.3 to 11.2 mm, 64 to 91 %
// were found.
constexpr double kAmplitudeError = 0.2;
constexpr std::size_t kMinMoving = 10;
constexpr double kMinContrast = 2.1;
// The poses' errors after the joint solve.
constexpr double kPoseSigma_m = 2e-3;
constexpr double kPoseSigma_rad = 3e-3;
// The errors of neighbouring patches are correlated: so many samples carry the information of one.
constexpr double kCorrelatedSamples = 20.0;

using PatchKey = std::uint64_t;

PatchKey CellOf(const Eigen::Vector3f& p) {
  PatchKey key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    constexpr std::int64_t kOffset = 1 << 20;
    key = (key << 21) | static_cast<PatchKey>(
                            static_cast<std::int64_t>(std::floor(p[axis] / kPatch_m)) + kOffset);
  }
  return key;
}

/// A movement of one rhythm, the same for the whole surface.
struct Rhythm {
  double angular_per_s = 0.0;
  double phase = 0.0;
  /// Squared distances that it explains where the surface follows it, divided by those where the
  /// surface moves against it. Errors do both about equally often.
  double contrast = 0.0;
  double excess = -std::numeric_limits<double>::infinity();  ///< Difference of the two.
};

/// Sums over a patch's samples, from which its regression on a cosine of any phase follows.
struct Moments {
  double weight = 0.0, c = 0.0, s = 0.0, y = 0.0;
  double cc = 0.0, cs = 0.0, ss = 0.0, cy = 0.0, sy = 0.0;
  double spread_cc = 0.0, spread_cs = 0.0, spread_ss = 0.0;  ///< About the means, unweighted.

  struct Regression {
    double xx = 0.0;  ///< 0 where the patch was not seen at enough phases.
    double xy = 0.0;
  };
  /// Of the distances on a * cos + b * sin.
  [[nodiscard]] Regression On(double a, double b) const {
    if (!(a * a * spread_cc + 2.0 * a * b * spread_cs + b * b * spread_ss >= kMinSpread)) return {};
    const double mean = (a * c + b * s) / weight;
    return {a * a * cc + 2.0 * a * b * cs + b * b * ss - weight * mean * mean,
            a * cy + b * sy - mean * y};
  }
};

/// The patches' distances as a surface, part of which may move in one rhythm, and errors of the
/// views' poses.
class SurfaceFit {
 public:
  SurfaceFit(std::span<const SurfacePatch> patches, std::span<const double> times_s)
      : patches_(patches),
        times_s_(times_s),
        surfaces_(patches.size()),
        of_view_(times_s.size()),
        twists_(times_s.size(), Vector6d::Zero()) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const SurfacePatch& patch : patches) middle += patch.centre_m.cast<double>();
    middle /= static_cast<double>(patches.size());
    for (std::size_t p = 0; p < patches.size(); ++p) {
      const Eigen::Vector3d n = patches[p].normal.cast<double>();
      surfaces_[p].direction << n, (patches[p].centre_m.cast<double>() - middle).cross(n);
      surfaces_[p].weights.reserve(patches[p].samples.size());
      for (std::size_t i = 0; i < patches[p].samples.size(); ++i) {
        of_view_[patches[p].samples[i].view].emplace_back(p, i);
        surfaces_[p].weights.push_back(patches[p].samples[i].weight);
      }
    }
    SetRhythm(0.0);
  }

  void Solve(int sweeps) {
    for (int sweep = 0; sweep < sweeps; ++sweep) {
      FitSurfaces();
      FitPoses();
    }
    FitSurfaces();
    MeasureNoise();
  }

  /// Lets the patches whose slope is larger move in a rhythm of this frequency, the others not.
  /// @return how many move.
  std::size_t LetMove(double angular_per_s, std::span<const double> slopes, double above) {
    SetRhythm(angular_per_s);
    std::size_t count = 0;
    for (std::size_t p = 0; p < patches_.size(); ++p) {
      surfaces_[p].moves = patches_[p].may_move && slopes[p] > above;  // not where it is NaN
      if (surfaces_[p].moves) ++count;
    }
    return count;
  }

  [[nodiscard]] Rhythm BestRhythm(double longest_period_s) const {
    std::array<Rhythm, kNumFrequencies> best;
    tbb::parallel_for(0, kNumFrequencies, [&](int i) {
      const double fraction = static_cast<double>(i) / (kNumFrequencies - 1);
      best[static_cast<std::size_t>(i)] =
          BestPhase(kTwoPi * ((1.0 - fraction) / longest_period_s + fraction / kShortestPeriod_s));
    });
    return *std::max_element(best.begin(), best.end(),
                             [](const Rhythm& a, const Rhythm& b) { return a.excess < b.excess; });
  }

  /// Half of the rise of each patch in this rhythm (metres), averaged with its neighbours; NaN
  /// where it is not known.
  [[nodiscard]] std::vector<double> Slopes(const Rhythm& rhythm) const {
    const std::vector<Moments> moments = MomentsAt(rhythm.angular_per_s);
    std::vector<Moments::Regression> regressions;
    for (const Moments& of_patch : moments)
      regressions.push_back(of_patch.On(std::cos(rhythm.phase), -std::sin(rhythm.phase)));
    std::vector<double> slopes(patches_.size(), std::numeric_limits<double>::quiet_NaN());
    tbb::parallel_for(std::size_t{0}, patches_.size(), [&](std::size_t p) {
      if (regressions[p].xx <= 0.0) return;
      Moments::Regression sum;
      int count = 0;
      for (std::size_t q = 0; q < patches_.size(); ++q) {
        if (regressions[q].xx <= 0.0 ||
            (patches_[p].centre_m - patches_[q].centre_m).squaredNorm() > kReach_m * kReach_m ||
            patches_[p].normal.dot(patches_[q].normal) < kSameSide)
          continue;
        sum.xx += regressions[q].xx;
        sum.xy += regressions[q].xy;
        ++count;
      }
      if (count >= kMinPatchNeighbours) slopes[p] = sum.xy / sum.xx;
    });
    return slopes;
  }

 private:
  struct Surface {
    Vector6d direction;  ///< Change of the distance with a view's twist (shift, then rotation).
    std::vector<double> weights;  ///< Of the samples, with their robust weights.
    Eigen::Vector3d terms = Eigen::Vector3d::Zero();  ///< Level, cosine and sine, metres.
    bool moves = false;
  };

  void SetRhythm(double angular_per_s) {
    basis_.clear();
    for (const double time_s : times_s_)
      basis_.emplace_back(1.0, std::cos(angular_per_s * time_s), std::sin(angular_per_s * time_s));
  }
  // Distance less the error of the view's pose.
  [[nodiscard]] double Corrected(std::size_t p, const PatchSample& sample) const {
    return sample.distance_m - surfaces_[p].direction.dot(twists_[sample.view]);
  }

  void FitSurfaces() {
    tbb::parallel_for(std::size_t{0}, patches_.size(), [&](std::size_t p) {
      Surface& surface = surfaces_[p];
      const std::vector<PatchSample>& samples = patches_[p].samples;
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      Eigen::Vector3d right = Eigen::Vector3d::Zero();
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const Eigen::Vector3d& f = basis_[samples[i].view];
        normal += surface.weights[i] * f * f.transpose();
        right += surface.weights[i] * Corrected(p, samples[i]) * f;
      }
      if (surface.moves) {
        normal.diagonal().tail<2>().array() += kRidge * normal(0, 0);
        surface.terms = normal.ldlt().solve(right);
      } else {
        surface.terms = {right[0] / normal(0, 0), 0.0, 0.0};
      }
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double left = Corrected(p, samples[i]) - surface.terms.dot(basis_[samples[i].view]);
        surface.weights[i] = samples[i].weight * CauchyWeight(left * left * samples[i].weight,
                                                              kCauchySigmas * sigma_m_);
      }
    });
  }

  void FitPoses() {
    const double prior = kCorrelatedSamples * sigma_m_ * sigma_m_;
    tbb::parallel_for(std::size_t{0}, times_s_.size(), [&](std::size_t v) {
      Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
      normal.diagonal().head<3>().setConstant(prior / (kPoseSigma_m * kPoseSigma_m));
      normal.diagonal().tail<3>().setConstant(prior / (kPoseSigma_rad * kPoseSigma_rad));
      Vector6d right = Vector6d::Zero();
      for (const auto& [p, i] : of_view_[v]) {
        const Surface& surface = surfaces_[p];
        const Vector6d weighted = surface.weights[i] * surface.direction;
        normal += weighted * surface.direction.transpose();
        right += (patches_[p].samples[i].distance_m - surface.terms.dot(basis_[v])) * weighted;
      }
      twists_[v] = normal.ldlt().solve(right);
    });
  }

  void MeasureNoise() {
    std::vector<double> magnitudes;
    for (std::size_t p = 0; p < patches_.size(); ++p)
      for (const PatchSample& sample : patches_[p].samples)
        magnitudes.push_back(
            std::abs(Corrected(p, sample) - surfaces_[p].terms.dot(basis_[sample.view])) *
            std::sqrt(static_cast<double>(sample.weight)));
    sigma_m_ = std::max(kLeastSigma_m, kMadToSigma * TakeMedian(magnitudes));
  }

  [[nodiscard]] std::vector<Moments> MomentsAt(double angular_per_s) const {
    std::vector<std::pair<double, double>> waves;
    for (const double time_s : times_s_)
      waves.emplace_back(std::cos(angular_per_s * time_s), std::sin(angular_per_s * time_s));
    std::vector<Moments> moments(patches_.size());
    for (std::size_t p = 0; p < patches_.size(); ++p) {
      Moments& m = moments[p];
      const std::vector<PatchSample>& samples = patches_[p].samples;
      double sum_c = 0.0;
      double sum_s = 0.0;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double w = surfaces_[p].weights[i];
        const auto [c, s] = waves[samples[i].view];
        const double y = Corrected(p, samples[i]) - surfaces_[p].terms[0];
        m.weight += w;
        m.c += w * c;
        m.s += w * s;
        m.y += w * y;
        m.cc += w * c * c;
        m.cs += w * c * s;
        m.ss += w * s * s;
        m.cy += w * c * y;
        m.sy += w * s * y;
        m.spread_cc += c * c;
        m.spread_cs += c * s;
        m.spread_ss += s * s;
        sum_c += c;
        sum_s += s;
      }
      const auto count = static_cast<double>(samples.size());
      m.spread_cc -= sum_c * sum_c / count;
      m.spread_cs -= sum_c * sum_s / count;
      m.spread_ss -= sum_s * sum_s / count;
    }
    return moments;
  }

  [[nodiscard]] Rhythm BestPhase(double angular_per_s) const {
    const std::vector<Moments> moments = MomentsAt(angular_per_s);
    Rhythm best;
    for (int k = 0; k < kNumPhases; ++k) {
      const double phase = kTwoPi * k / kNumPhases;
      const double a = std::cos(phase);
      const double b = -std::sin(phase);
      double with = 0.0;
      double against = 0.0;
      for (const Moments& of_patch : moments) {
        const Moments::Regression fit = of_patch.On(a, b);
        if (fit.xx > 0.0) (fit.xy > 0.0 ? with : against) += fit.xy * fit.xy / fit.xx;
      }
      if (with - against > best.excess)
        best = {angular_per_s, phase, with / std::max(against, 1e-12), with - against};
    }
    return best;
  }

  std::span<const SurfacePatch> patches_;
  std::span<const double> times_s_;
  std::vector<Surface> surfaces_;
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> of_view_;  // patch, sample
  std::vector<Vector6d> twists_;        // errors of the views' poses
  std::vector<Eigen::Vector3d> basis_;  // 1, cosine and sine at the views' times
  double sigma_m_ = 1e-3;               // of a sample of weight 1
};

}  // namespace

std::vector<SurfacePatch> MeasurePatches(std::span<const ViewSurface> views,
                                         const PointCloud& cloud, const std::stop_token& stop) {
  std::vector<std::pair<PatchKey, std::uint32_t>> points;
  const std::size_t stride = std::max(kPointStride, cloud.points.size() / kMaxPoints);
  for (std::size_t i = 0; i < cloud.points.size(); i += stride)
    points.emplace_back(CellOf(cloud.points[i]), static_cast<std::uint32_t>(i));
  std::sort(points.begin(), points.end());
  std::vector<std::span<const std::pair<PatchKey, std::uint32_t>>> cells;
  for (std::size_t first = 0, k = 0; k < points.size(); ++k) {
    if (k + 1 < points.size() && points[k + 1].first == points[first].first) continue;
    if (k + 1 - first >= kMinPoints)
      cells.push_back(std::span(points).subspan(first, k + 1 - first));
    first = k + 1;
  }
  const ViewFusion fusion(views, {});
  std::vector<SurfacePatch> patches(cells.size());
  tbb::parallel_for(std::size_t{0}, cells.size(), [&](std::size_t p) {
    CheckStop(stop);
    SurfacePatch& patch = patches[p];
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();
    for (const auto& [cell, i] : cells[p]) {
      patch.centre_m += cloud.points[i];
      normal += cloud.normals[i];
    }
    const auto count = static_cast<float>(cells[p].size());
    patch.centre_m /= count;
    if (!(normal.norm() > kMinNormalAgreement * count)) return;
    patch.normal = normal.normalized();
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Eigen::Vector3f way =
          patch.centre_m - views[v].T_world_camera.translation().cast<float>();
      const float depth_m = views[v].T_world_camera.linear().col(2).cast<float>().dot(way);
      if (!(depth_m > 0.0F && depth_m <= kMaxDepth_m)) continue;
      float sum_m = 0.0F;
      std::size_t seen = 0;
      for (const auto& [cell, i] : cells[p]) {
        const auto distance_m = fusion.Distance(v, cloud.points[i], cloud.normals[i]);
        if (!distance_m || std::abs(*distance_m) > kMaxDistance_m) continue;
        sum_m += *distance_m;
        ++seen;
      }
      if (2 * seen <= cells[p].size()) continue;
      const float cos_incidence = -patch.normal.dot(way) / way.norm();
      if (!(cos_incidence >= kMinPatchCosIncidence)) continue;
      const float depth2 = std::max(depth_m, kMinDepth_m) * std::max(depth_m, kMinDepth_m);
      patch.samples.push_back({static_cast<std::uint32_t>(v), sum_m / static_cast<float>(seen),
                               cos_incidence / (depth2 * depth2)});
    }
    if (patch.samples.size() < kMinSamples) patch.samples.clear();
  });
  std::erase_if(patches, [](const SurfacePatch& patch) { return patch.samples.empty(); });
  return patches;
}

std::optional<Breathing> FindBreathing(std::span<const SurfacePatch> patches,
                                       std::span<const double> times_s) {
  if (times_s.size() < kMinViews || patches.empty()) return std::nullopt;
  const auto [first, last] = std::minmax_element(times_s.begin(), times_s.end());
  const double duration_s = *last - *first;
  if (!(duration_s >= kMinDuration_s)) return std::nullopt;
  SurfaceFit fit(patches, times_s);
  fit.Solve(kFirstSweeps);
  // Each round but the last improves the surface for the next.
  for (int round = 0;; ++round) {
    const Rhythm rhythm = fit.BestRhythm(std::min(kLongestPeriod_s, duration_s));
    const std::vector<double> slopes = fit.Slopes(rhythm);
    std::vector<double> known;
    std::vector<double> sizes;
    for (const double slope : slopes) {
      if (std::isnan(slope)) continue;
      known.push_back(slope);
      sizes.push_back(std::abs(slope));
    }
    if (known.empty()) return std::nullopt;
    const double noise_m = kMadToSigma * TakeMedian(sizes);
    const double above_m = std::max(kSignificant * noise_m, -TakeQuantile(known, kLowestFraction));
    const std::size_t num_moving = fit.LetMove(rhythm.angular_per_s, slopes, above_m);
    std::vector<double> moving;
    for (std::size_t i = 0; i < slopes.size(); ++i)
      if (patches[i].may_move && slopes[i] > above_m) moving.push_back(slopes[i]);
    if (round < kMovementRounds && num_moving > 0) {
      fit.Solve(kSweeps);
      continue;
    }
    Breathing result;
    result.limit_m = kFoundAbove * above_m;
    if (num_moving < kMinMoving || rhythm.contrast < kMinContrast) return result;
    result.amplitude_m = 2.0 * TakeQuantile(moving, kMostAffected);
    result.sigma_m = std::hypot(2.0 * noise_m, kAmplitudeError * result.amplitude_m);
    result.period_s = kTwoPi / rhythm.angular_per_s;
    return result;
  }
}

}  // namespace plumb
