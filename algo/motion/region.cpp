// SPDX-License-Identifier: Apache-2.0
#include "algo/motion/region.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include "algo/base/polygon.hpp"
#include "algo/base/robust_weights.hpp"

namespace plumb {
namespace {

constexpr double kSegmentationSpacing_m = 0.01;
constexpr double kSegmentationSmoothing_m = 0.03;

// Surfaces higher than this above the support are body: above the noise, below a wrist.
constexpr double kMinHeight_m = 0.025;
constexpr double kMaxHeight_m = 0.6;   // higher surfaces are stands, hands or the gantry
constexpr double kBodyCell_m = 0.015;  // of the map of the body's outline
// largest tilt of a support against the frame's z axis; a marker may lie on a wedge
constexpr double kMaxTilt_rad = 0.35;
constexpr double kMinSupportArea_m2 = 0.08;  // no part of a body has a flat area as large as this

constexpr int kMaxPlanes = 6;
constexpr double kHistogramBin_m = 0.01;
constexpr double kCoarsePlaneBand_m =
    0.04;  // the first guess is level; 2 deg over 2 m are 35 mm at the ends
constexpr double kFinePlaneBand_m = 0.010;  // surfaces are uneven by some millimetres over a room
constexpr double kPlaneNormalCos = 0.985;   // 10 deg
constexpr double kCarriedFraction = 0.5;    // fraction of the largest carried area

struct FoundPlane {
  SupportPlane plane;
  std::vector<std::size_t> members;
};

// Weighted total least squares over the given samples with Tukey weights of the current residuals.
bool RefitPlane(const Surface& scene, const std::vector<std::size_t>& candidates, double band_m,
                double min_cos, SupportPlane& plane) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
  double total = 0.0;
  int count = 0;
  for (const std::size_t i : candidates) {
    const Eigen::Vector3d p = scene.points[i].cast<double>();
    const double u = plane.Height(p) / band_m;
    if (std::abs(u) >= 1.0 || scene.normals[i].cast<double>().dot(plane.normal) < min_cos) continue;
    const double w = TukeyWeight(u);
    mean += w * p;
    second += w * p * p.transpose();
    total += w;
    ++count;
  }
  if (count < 10 || total <= 0) return false;
  mean /= total;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(second / total -
                                                             mean * mean.transpose());
  Eigen::Vector3d normal = eigen.eigenvectors().col(0);
  if (normal.dot(plane.normal) < 0) normal = -normal;
  plane.normal = normal;
  plane.offset_m = normal.dot(mean);
  return true;
}

// Height (along z) with the most candidates.
double ModeHeight(const Surface& scene, const std::vector<std::size_t>& candidates) {
  float low = std::numeric_limits<float>::max();
  float high = std::numeric_limits<float>::lowest();
  for (const std::size_t i : candidates) {
    low = std::min(low, scene.points[i].z());
    high = std::max(high, scene.points[i].z());
  }
  std::vector<int> histogram(static_cast<std::size_t>((high - low) / kHistogramBin_m) + 3, 0);
  for (const std::size_t i : candidates)
    ++histogram[static_cast<std::size_t>((scene.points[i].z() - low) / kHistogramBin_m) + 1];
  std::size_t best = 1;
  int best_count = -1;
  for (std::size_t b = 1; b + 1 < histogram.size(); ++b) {
    const int count = histogram[b - 1] + 2 * histogram[b] + histogram[b + 1];
    if (count > best_count) {
      best_count = count;
      best = b;
    }
  }
  return low + (static_cast<double>(best) - 0.5) * kHistogramBin_m;
}

std::vector<FoundPlane> HorizontalPlanes(const Surface& scene) {
  const double cos_tilt = std::cos(kMaxTilt_rad);
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < scene.size(); ++i) {
    if (scene.normals[i].z() > cos_tilt) left.push_back(i);
  }
  const double area_per_sample = scene.spacing_m * scene.spacing_m;
  std::vector<FoundPlane> planes;
  for (int round = 0; round < 2 * kMaxPlanes && planes.size() < kMaxPlanes; ++round) {
    if (static_cast<double>(left.size()) * area_per_sample < kMinSupportArea_m2) break;
    FoundPlane found;
    found.plane.offset_m = ModeHeight(scene, left);
    bool fitted = true;
    for (double band = kCoarsePlaneBand_m; fitted && band > kFinePlaneBand_m; band *= 0.7) {
      fitted =
          RefitPlane(scene, left, band, band > 0.025 ? cos_tilt : kPlaneNormalCos, found.plane);
    }
    for (int i = 0; i < 3 && fitted; ++i)
      fitted = RefitPlane(scene, left, kFinePlaneBand_m, kPlaneNormalCos, found.plane);
    // Everything in the band is removed from the pool, member or not, so that every round makes
    // progress.
    std::vector<std::size_t> rest;
    for (const std::size_t i : left) {
      const double height = found.plane.Height(scene.points[i].cast<double>());
      const bool parallel =
          scene.normals[i].cast<double>().dot(found.plane.normal) > kPlaneNormalCos;
      if (fitted && std::abs(height) < kFinePlaneBand_m && parallel) found.members.push_back(i);
      if (std::abs(height) >= kFinePlaneBand_m) rest.push_back(i);
    }
    if (rest.size() == left.size()) break;
    left = std::move(rest);
    const bool level = found.plane.normal.z() > cos_tilt;
    if (level && static_cast<double>(found.members.size()) * area_per_sample >= kMinSupportArea_m2)
      planes.push_back(std::move(found));
  }
  return planes;
}

// The highest plane that carries nearly as much as any other: the couch rather than the floor.
std::optional<SupportPlane> ChooseSupport(const Surface& scene,
                                          const std::vector<FoundPlane>& planes) {
  std::vector<std::uint8_t> flat(scene.size(), 0);
  for (const FoundPlane& found : planes) {
    for (const std::size_t i : found.members) flat[i] = 1;
  }
  std::vector<int> carried(planes.size(), 0);
  for (std::size_t k = 0; k < planes.size(); ++k) {
    for (std::size_t i = 0; i < scene.size(); ++i) {
      const double height = planes[k].plane.Height(scene.points[i].cast<double>());
      if (flat[i] == 0 && height > kMinHeight_m && height < kMaxHeight_m) ++carried[k];
    }
  }
  if (planes.empty()) return std::nullopt;
  const int most = *std::max_element(carried.begin(), carried.end());
  const SupportPlane* best = nullptr;
  for (std::size_t k = 0; k < planes.size(); ++k) {
    if (carried[k] < kCarriedFraction * most) continue;
    if (best == nullptr || planes[k].plane.offset_m > best->offset_m) best = &planes[k].plane;
  }
  return *best;
}

// Keeps the largest 8-connected set of kBody cells; the others become kMeasured.
void KeepLargestComponent(Body& body) {
  const int width = body.grid.width;
  const int height = body.grid.height;
  std::vector<std::uint32_t> label(body.cells.size(), 0);  // 0: in no component yet.
  std::vector<std::size_t> stack;
  std::uint32_t best = 0;
  std::size_t best_size = 0;
  std::uint32_t next = 1;
  for (std::size_t start = 0; start < body.cells.size(); ++start) {
    if (body.cells[start] != Body::kBody || label[start] != 0) continue;
    std::size_t size = 0;
    stack.assign(1, start);
    label[start] = next;
    while (!stack.empty()) {
      const std::size_t cell = stack.back();
      stack.pop_back();
      ++size;
      const int row = static_cast<int>(cell) / width;
      const int column = static_cast<int>(cell) % width;
      for (int r = std::max(row - 1, 0); r <= std::min(row + 1, height - 1); ++r) {
        for (int c = std::max(column - 1, 0); c <= std::min(column + 1, width - 1); ++c) {
          const std::size_t other = body.grid.index(r, c);
          if (body.cells[other] != Body::kBody || label[other] != 0) continue;
          label[other] = next;
          stack.push_back(other);
        }
      }
    }
    if (size > best_size) {
      best_size = size;
      best = next;
    }
    ++next;
  }
  for (std::size_t i = 0; i < body.cells.size(); ++i) {
    if (body.cells[i] == Body::kBody && label[i] != best) body.cells[i] = Body::kMeasured;
  }
}

GridShape GridAround(const Surface& scene, double step) {
  GridShape grid;
  grid.step = step;
  if (scene.size() == 0) return grid;
  Eigen::Vector2f low = scene.points.front().head<2>();
  Eigen::Vector2f high = low;
  for (const Eigen::Vector3f& p : scene.points) {
    low = low.cwiseMin(p.head<2>());
    high = high.cwiseMax(p.head<2>());
  }
  grid.x_min = low.x() - step;
  grid.y_min = low.y() - step;
  grid.width = static_cast<int>((high.x() - low.x()) / step) + 3;
  grid.height = static_cast<int>((high.y() - low.y()) / step) + 3;
  return grid;
}

// Calls visit(cell index, surface point) for every valid cell of the map.
template <typename Visit>
void ForEachCell(const HeightMap& map, Visit&& visit) {
  for (int row = 0; row < map.grid.height; ++row) {
    for (int column = 0; column < map.grid.width; ++column) {
      const float z = map.at(row, column);
      if (!std::isfinite(z)) continue;
      visit(map.grid.index(row, column),
            Eigen::Vector3d(map.grid.x_centre(column), map.grid.y_centre(row), z));
    }
  }
}

}  // namespace

bool Body::HighEnough(const Eigen::Vector3d& p) const {
  if (!support) return true;
  const double height = support->Height(p);
  return height > min_height_m && height < max_height_m;
}

bool Body::Contains(const Eigen::Vector3d& p) const {
  const auto cell = grid.cell(p.x(), p.y());
  return cell && cells[*cell] == kBody && HighEnough(p);
}

namespace {

Body BodyOf(const Surface& scene, std::optional<SupportPlane> support) {
  Body body;
  body.min_height_m = kMinHeight_m;
  body.max_height_m = kMaxHeight_m;
  body.support = std::move(support);
  body.grid = GridAround(scene, kBodyCell_m);
  body.cells.assign(body.grid.num_cells(), Body::kUnknown);
  body.height_m.assign(body.grid.num_cells(), std::numeric_limits<float>::quiet_NaN());
  for (std::size_t i = 0; i < scene.size(); ++i) {
    const Eigen::Vector3d p = scene.points[i].cast<double>();
    const auto cell = body.grid.cell(p.x(), p.y());
    if (!cell) continue;
    const double height = body.support ? body.support->Height(p) : p.z();
    body.cells[*cell] = std::max<std::uint8_t>(body.cells[*cell],
                                               body.HighEnough(p) ? Body::kBody : Body::kMeasured);
    if (body.support && height >= kMaxHeight_m) continue;
    if (!(body.height_m[*cell] >= height)) body.height_m[*cell] = static_cast<float>(height);
  }
  KeepLargestComponent(body);
  return body;
}

Surface SegmentationSurface(const PointCloud& cloud) {
  return MakeSurface(cloud, kSegmentationSpacing_m, kSegmentationSmoothing_m);
}

}  // namespace

Body FindBody(const Surface& scene) {
  return BodyOf(scene, ChooseSupport(scene, HorizontalPlanes(scene)));
}

Body BodyOn(const SupportPlane& support, const PointCloud& scene_cloud) {
  return BodyOf(SegmentationSurface(scene_cloud), support);
}

Body FindBody(const PointCloud& scene_cloud) { return FindBody(SegmentationSurface(scene_cloud)); }

PointCloud SceneCloud(const Scene& scene, const Eigen::Affine3d& T_reference_scene) {
  const bool has_cloud = !scene.cloud.empty() && scene.cloud.normals.size() == scene.cloud.size();
  if (has_cloud) return TransformedCloud(T_reference_scene, scene.cloud);
  if (scene.height_map)
    return TransformedCloud(T_reference_scene, CloudOfHeightMap(*scene.height_map));
  return {};
}

Body BodyOfScene(const Scene& scene, const PointCloud& scene_cloud) {
  Body found = FindBody(scene_cloud);
  if (!scene.planning) return found;
  // A couch that was drawn into the contour; a flat belly lies higher.
  constexpr double kHighestCouch_m = 0.12;
  if (found.support && found.support->offset_m - scene.planning->support_m < kHighestCouch_m)
    return found;
  return BodyOn({.normal = Eigen::Vector3d::UnitZ(), .offset_m = scene.planning->support_m},
                scene_cloud);
}

std::vector<std::uint8_t> ReferenceRegion(const Scene& reference,
                                          const std::vector<Eigen::Vector2d>& polygon_m) {
  if (!reference.height_map) return {};
  return RegionMask(*reference.height_map,
                    BodyOfScene(reference, SceneCloud(reference, Eigen::Affine3d::Identity())),
                    polygon_m);
}

std::vector<std::uint8_t> RegionMask(const HeightMap& map, const Body& body,
                                     const std::vector<Eigen::Vector2d>& polygon_m) {
  std::vector<std::uint8_t> mask(map.grid.num_cells(), 0);
  bool any = false;
  ForEachCell(map, [&](std::size_t cell, const Eigen::Vector3d& p) {
    const bool inside = polygon_m.empty()
                            ? body.Contains(p)
                            : InsidePolygon(polygon_m, p.x(), p.y()) && body.HighEnough(p);
    mask[cell] = inside ? 1 : 0;
    any = any || inside;
  });
  if (any || polygon_m.empty()) return mask;
  // Nothing rises above the support in the polygon, so the flat surface itself was meant.
  ForEachCell(map, [&](std::size_t cell, const Eigen::Vector3d& p) {
    mask[cell] = InsidePolygon(polygon_m, p.x(), p.y()) ? 1 : 0;
  });
  return mask;
}

std::optional<Eigen::Vector3d> RegionCentroid(const HeightMap& map,
                                              const std::vector<std::uint8_t>& mask) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::size_t count = 0;
  ForEachCell(map, [&](std::size_t cell, const Eigen::Vector3d& p) {
    if (mask[cell] == 0) return;
    sum += p;
    ++count;
  });
  if (count == 0) return std::nullopt;
  return sum / static_cast<double>(count);
}

namespace {

// Twice as coarse as either map, so that no cell within a measured part remains empty.
GridShape CoverageGrid(const GridShape& fine, double current_step_m) {
  GridShape grid = fine;
  grid.step = 2 * std::max(fine.step, current_step_m);
  grid.width = static_cast<int>(std::ceil(fine.width * fine.step / grid.step));
  grid.height = static_cast<int>(std::ceil(fine.height * fine.step / grid.step));
  return grid;
}

// The cells that contain a point of the current scan, moved back by the inverse motion, so that
// cells correspond.
std::vector<std::uint8_t> MeasuredCells(const GridShape& grid, const PointCloud& current,
                                        const Pose& T_motion) {
  const Pose T_back = T_motion.inverse();
  std::vector<std::uint8_t> measured(grid.num_cells(), 0);
  for (const Eigen::Vector3f& p : current.points) {
    const Eigen::Vector3d moved = T_back * p.cast<double>();
    const auto cell = grid.cell(moved.x(), moved.y());
    if (cell) measured[*cell] = 1;
  }
  return measured;
}

struct FarthestCell {
  float distance = 0.0F;  // in cells
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
};

// The cell that is farthest from a cell of distance zero, by the chamfer distance (1, sqrt 2) in
// two passes: within 8 % of the Euclidean distance.
// @param distance  Zero, or the largest number for cells whose distance is to be found.
FarthestCell FindFarthest(const GridShape& grid, std::vector<float>& distance) {
  const auto relax = [&](int row, int column, int dr, int dc) {
    const int r = row + dr;
    const int c = column + dc;
    float& here = distance[grid.index(row, column)];
    const bool inside = grid.contains(r, c);
    const float there = inside ? distance[grid.index(r, c)] : 0.0F;
    here = std::min(here, there + (dr != 0 && dc != 0 ? 1.41421356F : 1.0F));
  };
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      for (const auto& [dr, dc] :
           {std::pair(0, -1), std::pair(-1, -1), std::pair(-1, 0), std::pair(-1, 1)})
        relax(row, column, dr, dc);
    }
  }
  FarthestCell farthest;
  for (int row = grid.height - 1; row >= 0; --row) {
    for (int column = grid.width - 1; column >= 0; --column) {
      for (const auto& [dr, dc] :
           {std::pair(0, 1), std::pair(1, 1), std::pair(1, 0), std::pair(1, -1)})
        relax(row, column, dr, dc);
      const float d = distance[grid.index(row, column)];
      if (d > farthest.distance) farthest = {d, {grid.x_centre(column), grid.y_centre(row)}};
    }
  }
  return farthest;
}

}  // namespace

RegionCoverage CoverageOf(const HeightMap& reference, const std::vector<std::uint8_t>& mask,
                          const PointCloud& current, double current_step_m, const Pose& T_motion) {
  const GridShape grid = CoverageGrid(reference.grid, current_step_m);
  const std::vector<std::uint8_t> measured = MeasuredCells(grid, current, T_motion);
  std::size_t region_cells = 0;
  std::size_t covered_cells = 0;
  std::vector<float> distance(grid.num_cells(), 0.0F);
  ForEachCell(reference, [&](std::size_t cell, const Eigen::Vector3d& p) {
    if (mask[cell] == 0) return;
    ++region_cells;
    const auto coarse = grid.cell(p.x(), p.y());
    if (!coarse) return;
    const bool covered = measured[*coarse] != 0;
    covered_cells += covered ? 1 : 0;
    if (!covered) distance[*coarse] = std::numeric_limits<float>::max();
  });
  RegionCoverage result;
  if (region_cells == 0) return result;
  result.coverage = static_cast<double>(covered_cells) / static_cast<double>(region_cells);
  const FarthestCell farthest = FindFarthest(grid, distance);
  if (!(farthest.distance > 0)) return result;
  result.hole_centre_m = farthest.centre_m;
  // Half a cell to the centre of the next measured cell on each side, and half a cell for cells
  // that are only partly measured.
  result.largest_hole_m = 2.0 * farthest.distance * grid.step;
  return result;
}

}  // namespace plumb
