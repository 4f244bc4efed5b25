// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/plan_options.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "web/model/limits.hpp"
#include "words/scan.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

[[noreturn]] void Fail(const Message& what) { throw DataError(say::scan::PlanUnusable(what)); }

PatientPosture PostureOf(std::string_view name) {
  if (const auto posture = Named<PatientPosture>(name)) return *posture;
  Fail(say::scan::PlanPosture(name.substr(0, 20)));
}

double CheckedTolerance(std::string_view field, double value) {
  if (!(std::isfinite(value) && value > 0)) Fail(say::scan::PlanTolerance(field, value));
  return value;
}

double CheckedStated_m(std::string_view field, double value_mm) {
  const Range& range = kStatedSurface_mm.stored;
  if (!range.Holds(value_mm))
    Fail(say::store::ValueOutOfRange(field, value_mm, range.least, range.most));
  return value_mm * kMillimetre;
}

template <std::size_t N>
void CheckPoint(std::string_view field, const std::array<double, N>& point) {
  if (!std::all_of(point.begin(), point.end(), [](double v) { return std::isfinite(v); }))
    Fail(say::scan::PlanPoint(field));
}

}  // namespace

ReferencePlan DefaultPlan(const Settings& settings) {
  return {.region_m = {},
          .isocentre_m = {},
          .tolerance = settings.tolerance,
          .posture = settings.posture,
          .couch_markers = settings.couch_markers};
}

CompareOptions CompareOptionsFor(const ReferencePlan& plan, const CompareOptions& configured) {
  CompareOptions options = configured;
  if (!plan.region_m.empty() && plan.region_m.size() < 3)
    Fail(say::scan::PlanRegion(static_cast<std::int64_t>(plan.region_m.size())));
  options.region_polygon_m.clear();
  for (const auto& corner : plan.region_m) {
    CheckPoint("region_m", corner);
    options.region_polygon_m.emplace_back(corner[0], corner[1]);
  }
  options.isocentre_m.reset();
  if (plan.isocentre_m) {
    CheckPoint("isocentre_m", *plan.isocentre_m);
    options.isocentre_m = Eigen::Vector3d(plan.isocentre_m->data());
  }
  options.marker_kind = plan.couch_markers ? MarkerKind::kCouch : MarkerKind::kRoom;
  options.posture = PostureOf(plan.posture);
  options.surface = {
      .clothing_u95_m = CheckedStated_m("clothing_mm", plan.clothing_mm),
      .ct_breathing_u95_m = CheckedStated_m("ct_breathing_mm", plan.ct_breathing_mm)};
  options.limits.shift_tolerance_m =
      CheckedTolerance("shift_tolerance_mm", plan.tolerance.shift_mm) * kMillimetre;
  options.limits.rotation_tolerance_rad =
      CheckedTolerance("rotation_tolerance_deg", plan.tolerance.rotation_deg) * kDegree;
  return options;
}

}  // namespace plumb
