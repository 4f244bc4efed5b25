// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/planned_scene.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/planning/contour_surface.hpp"
#include "algo/planning/couch_top.hpp"
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
// Of images: what is smaller is a tube or a cable. A couch sags, and its top is no exact plane.
constexpr double kLeastImagePart_m2 = 500e-6, kAboveCouch_m = 3 * kMillimetre;
// The skin that a camera sees may be that of another threshold: half-way between air and tissue,
// or as far on the other side; at least as far away as the second number.
constexpr double kHalfWay_hu = -500.0, kLeastThreshold_hu = 200.0;
constexpr double kPixelHalf = 0.2;         // of a pixel: twice the standard deviation of slices
constexpr double kMostThreshold_mm = 3.0;  // More, and the images do not show where the skin is.

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

void Warn(const ContourSurface& surface, std::int64_t num_slices, std::vector<Message>& warnings) {
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
  if (surface.cut_slices > 0)
    warnings.push_back(say::planning::ImagesCut(count(surface.cut_slices), num_slices));
  else if (surface.cut_at_side)
    warnings.push_back(say::planning::CutAtSide());
}

std::vector<ContourSlice> SlicesOf(const PlannedRoi& roi, const PlannedPlace& place) {
  const Eigen::Matrix3d R = IecFromPatient(place.posture);
  std::vector<ContourSlice> slices;
  for (const PlannedContour& contour : roi.contours)
    AddSlice(roi, contour, R, place.isocentre_mm, slices);
  return slices;
}

ContourSurface SurfaceOf(const std::string& name, std::vector<ContourSlice> slices,
                         const ContourSurfaceOptions& options, PlanningSource& source) {
  source.slices = CountPlaces(slices);
  if (source.slices < kFewestSlices)
    throw DataError(say::planning::FewSlices(name, source.slices, kFewestSlices));
  ContourSurface surface;
  try {
    surface = SurfaceFromAbove(std::move(slices), options);
  } catch (const std::invalid_argument&) {
    throw DataError(say::planning::NoSurface(name));
  }
  if (surface.spacing_m > kMostSpacing_m + kFlat_mm * kMillimetre)
    throw DataError(say::planning::SpacingTooWide(surface.spacing_m / kMillimetre,
                                                  kMostSpacing_m / kMillimetre));
  const bool any = std::any_of(surface.heights.z.begin(), surface.heights.z.end(),
                               [](float z) { return std::isfinite(z); });
  if (!any) throw DataError(say::planning::NoSurface(name));
  return surface;
}

// Top of the couch as a planning system has drawn it, in the frame of the images. It may be drawn
// as several structures, such as the surface and the inside of a shell, beside cushions and head
// rests: the highest of those that are flat along the scan counts.
std::optional<double> DrawnCouch(const StructureSet& structures, const CtSkin& images,
                                 const PlannedPlace& place) {
  std::optional<double> highest;
  for (const PlannedRoi& roi : structures.rois) {
    const std::string& frame = roi.frame_of_reference_uid;
    if (roi.type != "SUPPORT" || (!frame.empty() && frame != images.roi().frame_of_reference_uid))
      continue;
    if (const std::optional<double> top = FlatTop(SlicesOf(roi, place)))
      highest = std::max(highest.value_or(*top), *top);
  }
  return highest;
}

// Along its normal, 95 %, for the threshold.
double ThresholdHalf_mm(const CtSkin& images) {
  const double half_hu =
      std::max(kLeastThreshold_hu, std::abs(images.threshold_hu() - kHalfWay_hu));
  const double half_mm = half_hu / std::max(images.Steepness(), 1.0);
  if (half_mm > kMostThreshold_mm)
    throw DataError(say::planning::ImagesBlurred(images.Steepness(), images.threshold_hu(), half_mm,
                                                 kMostThreshold_mm));
  return half_mm;
}

void AddCuts(const CtSkin& images, const PlannedPlace& place, std::vector<ContourSlice>& slices) {
  const Eigen::Matrix3d R = IecFromPatient(place.posture);
  for (const std::vector<Eigen::Vector3d>& points_mm : images.cuts_mm()) {
    ContourSlice& slice = slices.emplace_back();
    for (const Eigen::Vector3d& p_mm : points_mm) {
      const Eigen::Vector3d p_m = kMillimetre * (R * (p_mm - place.isocentre_mm));
      slice.y_m = p_m.y();
      slice.cuts.emplace_back(p_m.x(), p_m.z());
    }
  }
}

ContourSurface SurfaceOfImages(const CtSkin& images, const std::optional<StructureSet>& structures,
                               const PlannedPlace& place, Scene& scene) {
  std::vector<ContourSlice> slices = SlicesOf(images.roi(), place);
  std::optional<double> couch = structures ? DrawnCouch(*structures, images, place) : std::nullopt;
  if (!couch) couch = CouchTop(slices);
  if (couch) RemoveBelow(*couch + kAboveCouch_m, slices);
  scene.warnings.push_back(couch ? say::planning::CouchRemoved(*couch / kMillimetre)
                                 : say::planning::CouchNotFound());
  AddCuts(images, place, slices);
  ContourSurface surface = SurfaceOf(images.roi().name, std::move(slices),
                                     {.min_area_m2 = kLeastImagePart_m2}, *scene.planning);
  const double threshold_mm = ThresholdHalf_mm(images);
  const double pixels_mm = kPixelHalf * images.pixel_mm();
  scene.planning->skin_u95_m = std::hypot(threshold_mm, pixels_mm) * kMillimetre;
  scene.warnings.push_back(say::planning::SkinOfImages(images.threshold_hu(), threshold_mm,
                                                       pixels_mm, images.pixel_mm()));
  return surface;
}

void FillSource(const TreatmentPlan& plan, const PlannedPlace& place, const ContourSurface& surface,
                PlanningSource& source) {
  source.posture = place.posture;
  source.isocentre_mm = place.isocentre_mm;
  source.beam = place.beam;
  source.plan_label = plan.file.label;
  source.plan_date = plan.file.date;
  source.approval = plan.approval;
  source.plan_uid = plan.file.instance_uid;
  source.structure_set_uid = plan.structure_set_uid;
  source.frame_of_reference_uid = plan.file.frame_of_reference_uid;
  source.slice_spacing_m = surface.spacing_m;
  source.parts_apart = static_cast<std::int64_t>(surface.parts_apart);
  source.parts_left_out = static_cast<std::int64_t>(surface.crumbs + surface.couch_parts);
  source.support_m = surface.support_m;
}

void SetSurface(const ContourSurface& surface, Scene& scene) {
  scene.height_map = surface.heights;
  scene.mesh = MeshOfHeightMap(surface.heights);
  scene.cloud.points = scene.mesh.vertices;
  scene.cloud.normals = scene.mesh.normals;
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
  const ContourSurface surface = SurfaceOf(roi.name, SlicesOf(roi, place), {}, source);
  source.roi = roi.name;
  FillSource(plan, place, surface, source);
  Warn(surface, source.slices, scene.warnings);
  scene.warnings.push_back(say::planning::SkinUnknown(source.skin_u95_m / kMillimetre));
  SetSurface(surface, scene);
  return scene;
}

Scene MakePlannedScene(const std::optional<StructureSet>& structures, const TreatmentPlan& plan,
                       const CtSkin& images, const PlanningChoice& choice) {
  if (structures && (choice.roi || HasExternal(*structures))) {
    Scene drawn = MakePlannedScene(*structures, plan, choice);
    RequireImagesOfPlan(images, plan, drawn.planning->posture);
    RequireOneFrame(*structures, images.roi(), plan);
    drawn.warnings.push_back(say::planning::ImagesNotUsed(drawn.planning->roi));
    return drawn;
  }
  if (choice.roi) throw DataError(say::planning::RoiOfNone(*choice.roi));
  Scene scene;
  scene.frame = SceneFrame::kIec;
  if (structures) {
    RequireOnePatient(*structures, plan);
    RequireUsablePlan(*structures, plan, scene.warnings);
  } else {
    RequireUsablePlan(plan, scene.warnings);
    scene.warnings.push_back(say::planning::ImagesByFrame());
  }
  const PlannedPlace place = ChoosePlace(plan, choice.beam, scene.warnings);
  RequireImagesOfPlan(images, plan, place.posture);
  RequireOneFrame(structures.value_or(StructureSet()), images.roi(), plan);
  images.RequireWhole();

  PlanningSource& source = scene.planning.emplace();
  const ContourSurface surface = SurfaceOfImages(images, structures, place, scene);
  source.roi = images.roi().name;
  source.skin_threshold_hu = images.threshold_hu();
  FillSource(plan, place, surface, source);
  Warn(surface, source.slices, scene.warnings);
  SetSurface(surface, scene);
  return scene;
}

}  // namespace plumb
