#include "algo/comparison/motion_start.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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

  std::vector<BodyCell> samples;
  const std::size_t stride = all_reference.size() / kMaxSamples + 1;
  for (std::size_t i = 0; i < all_reference.size(); i += stride)
    samples.push_back(all_reference[i]);
  const std::vector<float> map = SearchMap(current);
  const float limit = static_cast<float>(kHeightLimit_m);

  const auto cost_of = [&](const std::vector<Eigen::Vector2d>& turned,
                           const Eigen::Vector2d& shift) {
    float sum = 0.0F;
    int hits = 0;
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto cell = current.grid.cell(turned[i].x() + shift.x(), turned[i].y() + shift.y());
      const float height = cell ? map[*cell] : std::numeric_limits<float>::quiet_NaN();
      if (!std::isfinite(height)) {
        sum += kUnknownFraction * limit;
        continue;
      }
      hits += height > 0.0F ? 1 : 0;
      sum += height > 0.0F ? std::min(std::abs(height - samples[i].height), limit) : limit;
    }
    const double count = static_cast<double>(samples.size());
    const double uncovered = std::max(0.0, 1.0 - static_cast<double>(hits) / count * area_ratio);
    return static_cast<double>(sum) / count + uncovered * kHeightLimit_m;
  };

  const int yaw_steps = static_cast<int>(kMaxYaw_rad / kYawStep_rad);
  const int shift_steps = static_cast<int>(kMaxOffset_m / kOffsetStep_m);
  const std::size_t per_yaw =
      static_cast<std::size_t>((2 * shift_steps + 1) * (2 * shift_steps + 1));
  std::vector<Candidate> candidates(static_cast<std::size_t>(2 * yaw_steps + 1) * per_yaw);
  tbb::parallel_for(-yaw_steps, yaw_steps + 1, [&](int k) {
    const double yaw = k * kYawStep_rad;
    const Eigen::Rotation2Dd R(yaw);
    std::vector<Eigen::Vector2d> turned;
    for (const BodyCell& cell : samples)
      turned.push_back(R * (cell.xy - centre_reference) + centre_current);
    std::size_t slot = static_cast<std::size_t>(k + yaw_steps) * per_yaw;
    for (int iy = -shift_steps; iy <= shift_steps; ++iy) {
      for (int ix = -shift_steps; ix <= shift_steps; ++ix) {
        const Eigen::Vector2d offset(ix * kOffsetStep_m, iy * kOffsetStep_m);
        candidates[slot++] = {cost_of(turned, offset), yaw, offset};
      }
    }
  });
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });

  std::vector<Candidate> kept;
  for (const Candidate& candidate : candidates) {
    if (kept.size() >= kNumStarts) break;
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Candidate& other) {
      return std::abs(other.yaw_rad - candidate.yaw_rad) < kDistinctYaw_rad &&
             (other.offset - candidate.offset).norm() < kDistinctShift_m;
    });
    if (!known) kept.push_back(candidate);
  }
  std::vector<Pose> starts;
  for (const Candidate& candidate : kept) {
    const Eigen::Vector2d target = centre_current + candidate.offset;
    const Eigen::Vector3d from(centre_reference.x(), centre_reference.y(),
                               SupportHeightAt(reference, centre_reference));
    const Eigen::Vector3d to(target.x(), target.y(), SupportHeightAt(current, target));
    starts.push_back(Eigen::Translation3d(to) *
                     Pose(Eigen::AngleAxisd(candidate.yaw_rad, Eigen::Vector3d::UnitZ())) *
                     Eigen::Translation3d(-from));
  }
  return starts;
}

}  // namespace plumb
