// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/motion_start.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <tbb/parallel_for.h>

namespace plumb {
namespace {

// half range of the search about the support's normal; 60 deg are required
constexpr double kMaxYaw_rad = 1.6;
// 5 deg, or 26 mm at the end of a torso, which is well within reach of the refinement
constexpr double kYawStep_rad = 0.0873;
// largest distance of the centroids, which missing parts move apart
constexpr double kMaxOffset_m = 0.165;
constexpr double kOffsetStep_m = 0.03;
// upper limit of one difference; body against floor costs as much
constexpr double kHeightLimit_m = 0.04;
constexpr std::size_t kMaxSamples = 1500;  // cells of the reference body that are compared
constexpr std::size_t kNumStarts = 6;
// cost of an unmeasured cell as a fraction of the limit, because missing data is weak evidence
constexpr float kUnknownFraction = 0.7F;
constexpr double kDistinctYaw_rad = 0.21;  // 12 deg
constexpr double kDistinctShift_m = 0.05;

struct BodyCell {
  Eigen::Vector2d xy;
  float height = 0.0F;
};

std::vector<BodyCell> BodyCells(const Body& body) {
  std::vector<BodyCell> cells;
  for (std::size_t i = 0; i < body.cells.size(); ++i) {
    if (body.cells[i] != Body::kBody) continue;
    const int row = static_cast<int>(i) / body.grid.width;
    const int column = static_cast<int>(i) % body.grid.width;
    cells.push_back({{body.grid.x_centre(column), body.grid.y_centre(row)}, body.height_m[i]});
  }
  return cells;
}

Eigen::Vector2d Centroid(const std::vector<BodyCell>& cells) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const BodyCell& cell : cells) sum += cell.xy;
  return sum / static_cast<double>(cells.size());
}

// Heights of the body: 0 where something else was measured, NaN where nothing was measured. Single
// gaps are filled.
std::vector<float> SearchMap(const Body& body) {
  std::vector<float> map(body.cells.size(), std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < map.size(); ++i) {
    if (body.cells[i] == Body::kBody) map[i] = body.height_m[i];
    if (body.cells[i] == Body::kMeasured) map[i] = 0.0F;
  }
  std::vector<float> filled = map;
  const int width = body.grid.width;
  for (int row = 1; row + 1 < body.grid.height; ++row) {
    for (int column = 1; column + 1 < width; ++column) {
      const std::size_t here = body.grid.index(row, column);
      if (std::isfinite(map[here])) continue;
      float sum = 0.0F;
      int count = 0;
      for (int r = -1; r <= 1; ++r) {
        for (int c = -1; c <= 1; ++c) {
          const float z = map[body.grid.index(row + r, column + c)];
          if (!std::isfinite(z)) continue;
          sum += z;
          ++count;
        }
      }
      if (count >= 4) filled[here] = sum / static_cast<float>(count);
    }
  }
  return filled;
}

struct Candidate {
  double cost = std::numeric_limits<double>::max();
  double yaw_rad = 0.0;
  Eigen::Vector2d offset = Eigen::Vector2d::Zero();
};

double SupportHeightAt(const Body& body, const Eigen::Vector2d& xy) {
  if (!body.support) return 0.0;
  const Eigen::Vector3d& n = body.support->normal;
  return (body.support->offset_m - n.x() * xy.x() - n.y() * xy.y()) / n.z();
}

// Evenly chosen cells, at most kMaxSamples.
std::vector<BodyCell> EveryNth(const std::vector<BodyCell>& cells) {
  std::vector<BodyCell> some;
  const std::size_t stride = cells.size() / kMaxSamples + 1;
  for (std::size_t i = 0; i < cells.size(); i += stride) some.push_back(cells[i]);
  return some;
}

// Compares a turned and shifted reference body with the current one.
class HeightComparison {
 public:
  HeightComparison(const Body& current, std::vector<BodyCell> samples, double area_ratio)
      : grid_(current.grid),
        map_(SearchMap(current)),
        samples_(std::move(samples)),
        area_ratio_(area_ratio) {}

  [[nodiscard]] const std::vector<BodyCell>& samples() const { return samples_; }

  /// Mean difference of the heights, and what the reference leaves uncovered of the current body.
  /// @param turned  The places of samples() before the shift.
  [[nodiscard]] double Cost(const std::vector<Eigen::Vector2d>& turned,
                            const Eigen::Vector2d& shift) const {
    constexpr auto kLimit = static_cast<float>(kHeightLimit_m);
    float sum = 0.0F;
    int hits = 0;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      const auto cell = grid_.cell(turned[i].x() + shift.x(), turned[i].y() + shift.y());
      const float height = cell ? map_[*cell] : std::numeric_limits<float>::quiet_NaN();
      if (!std::isfinite(height)) {
        sum += kUnknownFraction * kLimit;
      } else if (height > 0.0F) {
        ++hits;
        sum += std::min(std::abs(height - samples_[i].height), kLimit);
      } else {
        sum += kLimit;
      }
    }
    const auto count = static_cast<double>(samples_.size());
    const double uncovered = std::max(0.0, 1.0 - static_cast<double>(hits) / count * area_ratio_);
    return static_cast<double>(sum) / count + uncovered * kHeightLimit_m;
  }

 private:
  const GridShape& grid_;
  std::vector<float> map_;
  std::vector<BodyCell> samples_;
  double area_ratio_;  // of the reference body to the current one
};

// Every turn and shift of the grid, the cheapest first.
std::vector<Candidate> SearchGrid(const HeightComparison& comparison,
                                  const Eigen::Vector2d& centre_reference,
                                  const Eigen::Vector2d& centre_current) {
  constexpr int kYawSteps = static_cast<int>(kMaxYaw_rad / kYawStep_rad);
  constexpr int kShiftSteps = static_cast<int>(kMaxOffset_m / kOffsetStep_m);
  constexpr std::size_t kPerYaw =
      static_cast<std::size_t>((2 * kShiftSteps + 1) * (2 * kShiftSteps + 1));
  std::vector<Candidate> candidates(static_cast<std::size_t>(2 * kYawSteps + 1) * kPerYaw);
  tbb::parallel_for(-kYawSteps, kYawSteps + 1, [&](int k) {
    const double yaw = k * kYawStep_rad;
    const Eigen::Rotation2Dd R(yaw);
    std::vector<Eigen::Vector2d> turned;
    for (const BodyCell& cell : comparison.samples())
      turned.push_back(R * (cell.xy - centre_reference) + centre_current);
    std::size_t slot = static_cast<std::size_t>(k + kYawSteps) * kPerYaw;
    for (int iy = -kShiftSteps; iy <= kShiftSteps; ++iy) {
      for (int ix = -kShiftSteps; ix <= kShiftSteps; ++ix) {
        const Eigen::Vector2d offset(ix * kOffsetStep_m, iy * kOffsetStep_m);
        candidates[slot++] = {comparison.Cost(turned, offset), yaw, offset};
      }
    }
  });
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
  return candidates;
}

// The first kNumStarts that differ from each other.
std::vector<Candidate> FirstDistinct(const std::vector<Candidate>& candidates) {
  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates) {
    if (kept.size() >= kNumStarts) break;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Candidate& other) {
      return std::abs(other.yaw_rad - candidate.yaw_rad) < kDistinctYaw_rad &&
             (other.offset - candidate.offset).norm() < kDistinctShift_m;
    });
    if (!known) kept.push_back(candidate);
  }
  return kept;
}

}  // namespace

std::vector<Pose> MotionStarts(const Body& reference, const Body& current) {
  const std::vector<BodyCell> all_reference = BodyCells(reference);
  const std::vector<BodyCell> all_current = BodyCells(current);
  if (all_reference.empty() || all_current.empty()) return {};
  const Eigen::Vector2d centre_reference = Centroid(all_reference);
  const Eigen::Vector2d centre_current = Centroid(all_current);
  const double area_ratio =
      static_cast<double>(all_reference.size()) / static_cast<double>(all_current.size()) *
      (reference.grid.step * reference.grid.step) / (current.grid.step * current.grid.step);
  const HeightComparison comparison(current, EveryNth(all_reference), area_ratio);
  const Eigen::Vector3d from(centre_reference.x(), centre_reference.y(),
                             SupportHeightAt(reference, centre_reference));
  std::vector<Pose> starts;
  for (const Candidate& candidate :
       FirstDistinct(SearchGrid(comparison, centre_reference, centre_current))) {
    const Eigen::Vector2d target = centre_current + candidate.offset;
    const Eigen::Vector3d to(target.x(), target.y(), SupportHeightAt(current, target));
    starts.push_back(Eigen::Translation3d(to) *
                     Pose(Eigen::AngleAxisd(candidate.yaw_rad, Eigen::Vector3d::UnitZ())) *
                     Eigen::Translation3d(-from));
  }
  return starts;
}

}  // namespace plumb
