// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/planned_scene.hpp"

#include <algorithm>
#include <cmath>
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
  return Joined(std::move(slices));
}

ContourSurface SurfaceOf(const std::string& name, std::vector<ContourSlice> slices,
                         const ContourSurfaceOptions& options, PlanningSource& source) {
  slices = Joined(std::move(slices));
  source.slices = std::ssize(slices);
  if (source.slices < kFewestSlices)
    throw DataError(say::planning::FewSlices(name, source.slices, kFewestSlices));
  ContourSurface surface;
  try {
    surface = SurfaceFromAbove(std::move(slices), options);
  } catch (const RaggedContours&) {
    throw DataError(say::planning::ContoursRagged(name));
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

// What a planning system has drawn beneath the body, in the frame of the images: the surface and
// the inside of the couch's shell as structures of their own, cushions, boards and head rests.
std::vector<DrawnSupport> DrawnSupports(const StructureSet& structures, const CtSkin& images,
                                        const PlannedPlace& place) {
  std::vector<DrawnSupport> supports;
  for (const PlannedRoi& roi : structures.rois) {
    const std::string& frame = roi.frame_of_reference_uid;
    if (roi.type != "SUPPORT" || (!frame.empty() && frame != images.roi().frame_of_reference_uid))
      continue;
    DrawnSupport support{.name = roi.name, .slices = SlicesOf(roi, place)};
    if (!support.slices.empty()) supports.push_back(std::move(support));
  }
  return supports;
}

void RemoveCouch(const std::vector<DrawnSupport>& supports, std::vector<ContourSlice>& slices,
                 std::vector<Message>& warnings) {
  const DrawnCouch drawn = CouchAsDrawn(slices, supports);
  for (const DrawnCouch::Part& part : drawn.parts)
    warnings.push_back(say::planning::CouchDrawn(part.name, part.top_m / kMillimetre));
  if (!drawn.not_used.empty()) warnings.push_back(say::planning::SupportsNotUsed(drawn.not_used));
  for (std::size_t i = 0; i < drawn.top_m.size(); ++i)
    RemoveBelow(drawn.top_m[i] + kAboveCouch_m, slices[i]);
  if (!drawn.top_m.empty()) return;
  const std::optional<double> top_m = CouchTop(slices);
  warnings.push_back(top_m ? say::planning::CouchRemoved(*top_m / kMillimetre)
                           : say::planning::CouchNotFound());
  for (ContourSlice& slice : slices)
    if (top_m) RemoveBelow(*top_m + kAboveCouch_m, slice);
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
  RemoveCouch(structures ? DrawnSupports(*structures, images, place) : std::vector<DrawnSupport>(),
              slices, scene.warnings);
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
  if (structures) images.RequireNamed(*structures);

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
