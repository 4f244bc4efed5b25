// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/breathing_mode.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"

namespace plumb {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeastRatio = 5.0;     // of the first component to the third,
constexpr double kLeastToSecond = 2.0;  // and to the second, which is breathing, too, where it
constexpr double kLagToThird = 2.0;     // stands out from the third.
constexpr double kSmoothing_s = 0.4;
constexpr double kShortestBreath_s = 1.5;
constexpr double kLeastOverlap_s = 2.0;
constexpr double kSurelyLonger_s = 0.3;
constexpr double kLeastAmplitude_m = 0.5 * kMillimetre;

// Mean over the 3 x 3 blocks around one of the region, of those that have a value.
std::vector<float> Smoothed(const std::vector<float>& values, const std::vector<std::uint8_t>& used,
                            const BlockGrid& grid) {
  std::vector<float> smooth(values.size(), 0.0F);
  for (int row = 1; row + 1 < grid.rows; ++row) {
    for (int column = 1; column + 1 < grid.columns; ++column) {
      const auto at = [&](int dr, int dc) {
        return static_cast<std::size_t>(row + dr) * static_cast<std::size_t>(grid.columns) +
               static_cast<std::size_t>(column + dc);
      };
      if (used[at(0, 0)] == 0) continue;
      float sum = 0.0F;
      int count = 0;
      for (int dr = -1; dr <= 1; ++dr) {
        for (int dc = -1; dc <= 1; ++dc) {
          if (used[at(dr, dc)] == 0) continue;
          sum += values[at(dr, dc)];
          ++count;
        }
      }
      smooth[at(0, 0)] = sum / static_cast<float>(count);
    }
  }
  return smooth;
}

std::vector<std::uint8_t> AlwaysSeen(const BlockSeries& series, const ViewModel& model) {
  std::vector<std::uint8_t> used(model.part.size(), 0);
  for (std::size_t b = 0; b < used.size(); ++b) {
    if (model.part[b] != SurfacePart::kRegion) continue;
    std::size_t count = 0;
    for (const auto& frame : series.inverse_depth) count += frame[b] > 0 ? 1 : 0;
    used[b] = 10 * count >= 9 * series.size() ? 1 : 0;
  }
  return used;
}

// Rows: blocks that were used; columns: frames. Metres along the normal, about the mean.
MatrixXd RisesOf(const BlockSeries& series, const ViewModel& model, const BlockGrid& grid,
                 const Eigen::Matrix3f& R_scene_camera, const std::vector<std::uint8_t>& used,
                 std::vector<std::size_t>& blocks) {
  const std::vector<float> mean = MeanOf(series, {0, series.size()});
  for (std::size_t b = 0; b < used.size(); ++b) {
    if (used[b] != 0 && mean[b] > 0) blocks.push_back(b);
  }
  MatrixXd rises(static_cast<Eigen::Index>(blocks.size()),
                 static_cast<Eigen::Index>(series.size()));
  std::vector<float> rise(used.size(), 0.0F), along(used.size(), 0.0F);
  for (const std::size_t b : blocks) {
    const Eigen::Vector3f ray(grid.centre_ray[b].x(), grid.centre_ray[b].y(), 1.0F);
    along[b] = -model.normal[b].dot(R_scene_camera * ray);
  }
  for (std::size_t k = 0; k < series.size(); ++k) {
    for (const std::size_t b : blocks) {
      const float inverse = series.inverse_depth[k][b];
      // A surface that is nearer along the ray has risen along its normal by the cosine of it.
      rise[b] = inverse > 0 ? (1.0F / mean[b] - 1.0F / inverse) * along[b] : 0.0F;
    }
    const std::vector<float> smooth = Smoothed(rise, used, grid);
    for (std::size_t i = 0; i < blocks.size(); ++i)
      rises(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = smooth[blocks[i]];
  }
  return rises.colwise() - rises.rowwise().mean();
}

std::vector<double> SmoothedInTime(const VectorXd& values, const std::vector<double>& time_s) {
  std::vector<double> smooth;
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    double sum = 0;
    int count = 0;
    for (std::size_t j = 0; j < time_s.size(); ++j) {
      if (std::abs(time_s[j] - time_s[k]) > 0.5 * kSmoothing_s) continue;
      sum += values[static_cast<Eigen::Index>(j)];
      ++count;
    }
    smooth.push_back(sum / count);
  }
  return smooth;
}

struct Breaths {
  std::pair<std::size_t, std::size_t> last;
  double period_s = 0.0;
  double low = 0.0, high = 0.0;  // Ends of expiration and inspiration.
  bool is_whole = false;
};

// The shift in time after which the signal is most like itself, once it was unlike itself: then its
// last stretch of that length is one whole breath, wherever it begins.
std::optional<Breaths> FindBreaths(const VectorXd& trace, const std::vector<double>& time_s) {
  constexpr double kUnlike = 0.7, kLike = 0.35;  // Differences in variances of the signal.
  const std::vector<double> smooth = SmoothedInTime(trace, time_s);
  std::vector<double> sorted = smooth;
  Breaths breaths{
      .last = {}, .low = TakeQuantile(sorted, 0.08), .high = TakeQuantile(sorted, 0.95)};
  double mean = 0, variance = 0;
  const auto all = static_cast<double>(smooth.size());
  for (const double x : smooth) mean += x / all;
  for (const double x : smooth) variance += (x - mean) * (x - mean) / all;
  bool was_unlike = false;
  double best = kLike, longest_s = 0;
  for (std::size_t lag = 1; lag < smooth.size(); ++lag) {
    if (time_s.back() - time_s[lag] < kLeastOverlap_s) break;
    double difference = 0;
    for (std::size_t k = lag; k < smooth.size(); ++k)
      difference += (smooth[k] - smooth[k - lag]) * (smooth[k] - smooth[k - lag]);
    difference /= 2 * variance * static_cast<double>(smooth.size() - lag);
    was_unlike = was_unlike || difference > kUnlike;
    const double period_s = time_s.back() - time_s[time_s.size() - 1 - lag];
    longest_s = period_s;
    if (!was_unlike || period_s < kShortestBreath_s || difference >= best) continue;
    best = difference;
    breaths.period_s = period_s;
    breaths.last = {smooth.size() - lag, smooth.size()};
  }
  if (!(breaths.period_s > 0)) return std::nullopt;
  breaths.is_whole = longest_s - breaths.period_s >= kSurelyLonger_s;
  return breaths;
}

// The highest blocks among those that move about as much as the most moving ones.
std::vector<Eigen::Index> BellyTop(const VectorXd& pattern, const std::vector<std::size_t>& blocks,
                                   const ViewModel& model, const Eigen::Vector3d& up) {
  constexpr std::size_t kMost = 40;
  std::vector<double> size(pattern.data(), pattern.data() + pattern.size());
  const double most = TakeQuantile(size, 0.98);
  std::vector<std::pair<double, Eigen::Index>> heights;
  for (Eigen::Index i = 0; i < pattern.size(); ++i) {
    const std::size_t block = blocks[static_cast<std::size_t>(i)];
    constexpr double kNearlyMost = 0.8;
    if (pattern[i] > kNearlyMost * most)
      heights.emplace_back(up.dot(model.point[block].cast<double>()), i);
  }
  std::sort(heights.begin(), heights.end(), std::greater<>());
  heights.resize(std::min(heights.size(), kMost));
  std::vector<Eigen::Index> top;
  for (const auto& [height, i] : heights) top.push_back(i);
  return top;
}

double MeanAt(const VectorXd& values, const std::vector<Eigen::Index>& at) {
  double sum = 0;
  for (const Eigen::Index i : at) sum += values[i];
  return at.empty() ? 0.0 : sum / static_cast<double>(at.size());
}

std::vector<float> ByBlock(const VectorXd& pattern, const std::vector<std::size_t>& blocks,
                           std::size_t size) {
  std::vector<float> values(size, 0.0F);
  for (std::size_t i = 0; i < blocks.size(); ++i)
    values[blocks[i]] = static_cast<float>(pattern[static_cast<Eigen::Index>(i)]);
  return values;
}

}  // namespace

std::vector<float> MeanOf(const BlockSeries& series, std::pair<std::size_t, std::size_t> frames) {
  if (series.size() == 0) return {};
  std::vector<float> sum(series.inverse_depth.front().size(), 0.0F);
  std::vector<int> count(sum.size(), 0);
  for (std::size_t k = frames.first; k < frames.second; ++k) {
    for (std::size_t b = 0; b < sum.size(); ++b) {
      const float inverse = series.inverse_depth[k][b];
      if (inverse <= 0) continue;
      sum[b] += inverse;
      ++count[b];
    }
  }
  const auto least = static_cast<int>(frames.second - frames.first + 1) / 2;
  for (std::size_t b = 0; b < sum.size(); ++b)
    sum[b] = count[b] > 0 && count[b] >= least ? sum[b] / static_cast<float>(count[b]) : 0.0F;
  return sum;
}

std::optional<BreathingMode> LearnBreathing(const BlockSeries& series, const ViewModel& model,
                                            const BlockGrid& grid, const Pose& T_scene_camera,
                                            const Eigen::Vector3d& up) {
  constexpr std::size_t kLeastFrames = 20;
  constexpr std::size_t kLeastBlocks = 200;
  if (series.size() < kLeastFrames) return std::nullopt;
  const std::vector<std::uint8_t> used = AlwaysSeen(series, model);
  std::vector<std::size_t> blocks;
  const MatrixXd rises =
      RisesOf(series, model, grid, T_scene_camera.linear().cast<float>(), used, blocks);
  if (blocks.size() < kLeastBlocks) return std::nullopt;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(rises.transpose() * rises);
  const VectorXd values = solver.eigenvalues();
  const Eigen::Index last = values.size() - 1;
  const double total = values.sum();
  if (!(total > 0) || values[last] < kLeastRatio * values[last - 2] ||
      values[last] < kLeastToSecond * values[last - 1])
    return std::nullopt;

  VectorXd trace = solver.eigenvectors().col(last);
  VectorXd pattern = rises * trace;
  if (pattern.sum() < 0) {
    trace = -trace;
    pattern = -pattern;
  }
  const std::vector<Eigen::Index> top = BellyTop(pattern, blocks, model, up);
  const double belly = MeanAt(pattern, top);
  if (!(belly > 0)) return std::nullopt;
  const double size = pattern.norm() / belly;
  trace *= belly;

  BreathingMode mode{.rise = ByBlock(pattern / belly, blocks, model.part.size()), .lag = {}};
  VectorXd lag = VectorXd::Zero(trace.size());
  if (values[last - 1] > kLagToThird * values[last - 2]) {
    lag = solver.eigenvectors().col(last - 1);
    VectorXd second = rises * lag;
    const double scale = second.norm() / size;  // As large as the first.
    lag *= scale;
    second /= scale;
    mode.lag = ByBlock(second, blocks, model.part.size());
    mode.lag_at_belly = MeanAt(second, top);
    mode.lag_sigma_m = lag.norm() / std::sqrt(static_cast<double>(lag.size()));
  }
  const VectorXd height = trace + mode.lag_at_belly * lag;
  const std::optional<Breaths> breaths = FindBreaths(height, series.time_s);
  if (!breaths || breaths->high - breaths->low < kLeastAmplitude_m) return std::nullopt;
  mode.end_expiration_m = breaths->low;
  mode.period_s = breaths->period_s;
  mode.amplitude_m = breaths->high - breaths->low;
  mode.last_breath = breaths->last;
  mode.is_whole = breaths->is_whole;
  for (Eigen::Index i = 0; i < 3; ++i)
    mode.shares[static_cast<std::size_t>(i)] = values[last - i] / total;
  for (Eigen::Index k = 0; k < trace.size(); ++k) mode.sizes_m.emplace_back(trace[k], lag[k]);
  return mode;
}

}  // namespace plumb
