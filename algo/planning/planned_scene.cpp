// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/planned_scene.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/planning/contour_surface.hpp"
#include "algo/planning/iec_axes.hpp"
#include "algo/planning/plan_choices.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "words/planning.hpp"

namespace plumb {
namespace {

constexpr double kFlat_mm = 0.01;
constexpr double kMostReach_m = 3.0;  // of a point from the isocentre
constexpr double kWideSpacing_m = 5 * kMillimetre, kMostSpacing_m = 6 * kMillimetre;
constexpr std::int64_t kFewestSlices = 5;

// A contour of a slice in IEC axes; nothing for what is no part of a surface, such as a point.
void AddSlice(const PlannedRoi& roi, const PlannedContour& contour, const Eigen::Matrix3d& R,
              const Eigen::Vector3d& isocentre_mm, std::vector<ContourSlice>& slices) {
  const auto found = static_cast<std::int64_t>(contour.points_mm.size());
  const double z_mm = found > 0 ? contour.points_mm.front().z() : 0.0;
  if (contour.stated_points >= 0 && contour.stated_points != found)
    throw DataError(say::planning::PointsLost(roi.name, z_mm, contour.stated_points, found));
  if (contour.kind != "CLOSED_PLANAR" || found < 3) return;
  ContourSlice& slice = slices.emplace_back();
  FlatContour& flat = slice.contours.emplace_back();
  double spread_mm = 0.0;
  for (const Eigen::Vector3d& p_mm : contour.points_mm) {
    const Eigen::Vector3d p_m = kMillimetre * (R * (p_mm - isocentre_mm));
    if (!(p_m.norm() <= kMostReach_m)) throw DataError(say::planning::FarAway(roi.name));
    spread_mm = std::max(spread_mm, std::abs(p_mm.z() - z_mm));
    slice.y_m = p_m.y();
    flat.emplace_back(p_m.x(), p_m.z());
  }
  if (spread_mm > kFlat_mm) throw DataError(say::planning::Oblique(roi.name, spread_mm));
  if (flat.front() == flat.back()) flat.pop_back();
}

std::int64_t CountPlaces(const std::vector<ContourSlice>& slices) {
  std::set<std::int64_t> places;
  for (const ContourSlice& slice : slices) places.insert(std::llround(slice.y_m * 1e5));
  return static_cast<std::int64_t>(places.size());
}

void Warn(const ContourSurface& surface, std::vector<Message>& warnings) {
  const auto count = [](std::size_t n) { return static_cast<std::int64_t>(n); };
  if (surface.spacing_m > kWideSpacing_m + kFlat_mm * kMillimetre)
    warnings.push_back(say::planning::SpacingWide(surface.spacing_m / kMillimetre));
  if (surface.gaps > 0) warnings.push_back(say::planning::SliceGaps(count(surface.gaps)));
  if (surface.parts_apart > 0)
    warnings.push_back(say::planning::PartsApart(count(surface.parts_apart)));
  if (surface.couch_parts > 0)
    warnings.push_back(say::planning::CouchParts(count(surface.couch_parts)));
  if (surface.repeated > 0)
    warnings.push_back(say::planning::ContoursRepeated(count(surface.repeated)));
  if (surface.cut_at_side) warnings.push_back(say::planning::CutAtSide());
}

ContourSurface SurfaceOf(const PlannedRoi& roi, const PlannedPlace& place, PlanningSource& source) {
  const Eigen::Matrix3d R = IecFromPatient(place.posture);
  std::vector<ContourSlice> slices;
  for (const PlannedContour& contour : roi.contours)
    AddSlice(roi, contour, R, place.isocentre_mm, slices);
  source.slices = CountPlaces(slices);
  if (source.slices < kFewestSlices)
    throw DataError(say::planning::FewSlices(roi.name, source.slices, kFewestSlices));
  ContourSurface surface;
  try {
    surface = SurfaceFromAbove(std::move(slices));
  } catch (const std::invalid_argument&) {
    throw DataError(say::planning::NoSurface(roi.name));
  }
  if (surface.spacing_m > kMostSpacing_m + kFlat_mm * kMillimetre)
    throw DataError(say::planning::SpacingTooWide(surface.spacing_m / kMillimetre,
                                                  kMostSpacing_m / kMillimetre));
  const bool any = std::any_of(surface.heights.z.begin(), surface.heights.z.end(),
                               [](float z) { return std::isfinite(z); });
  if (!any) throw DataError(say::planning::NoSurface(roi.name));
  return surface;
}

}  // namespace

Scene MakePlannedScene(const StructureSet& structures, const TreatmentPlan& plan,
                       const PlanningChoice& choice) {
  Scene scene;
  scene.frame = SceneFrame::kIec;
  RequireOnePatient(structures, plan);
  RequireUsablePlan(structures, plan, scene.warnings);
  const PlannedPlace place = ChoosePlace(plan, choice.beam, scene.warnings);
  const PlannedRoi& roi = ChooseRoi(structures, choice.roi);
  RequireOneFrame(structures, roi, plan);

  PlanningSource& source = scene.planning.emplace();
  const ContourSurface surface = SurfaceOf(roi, place, source);
  source.roi = roi.name;
  source.posture = place.posture;
  source.isocentre_mm = place.isocentre_mm;
  source.beam = place.beam;
  source.plan_label = plan.file.label;
  source.plan_date = plan.file.date;
  source.approval = plan.approval;
  source.plan_uid = plan.file.instance_uid;
  source.structure_set_uid = structures.file.instance_uid;
  source.frame_of_reference_uid = plan.file.frame_of_reference_uid;
  source.slice_spacing_m = surface.spacing_m;
  source.parts_apart = static_cast<std::int64_t>(surface.parts_apart);
  source.parts_left_out = static_cast<std::int64_t>(surface.crumbs + surface.couch_parts);
  source.support_m = surface.support_m;
  Warn(surface, scene.warnings);
  scene.warnings.push_back(say::planning::SkinUnknown(source.skin_u95_m / kMillimetre));

  scene.height_map = surface.heights;
  scene.mesh = MeshOfHeightMap(surface.heights);
  scene.cloud.points = scene.mesh.vertices;
  scene.cloud.normals = scene.mesh.normals;
  return scene;
}

}  // namespace plumb
