#include "daemon/appliance/plan_options.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"

namespace plumb {
namespace {

[[noreturn]] void Fail(std::string_view what) {
  throw DataError(fmt::format(
      "the approved plan of the reference cannot be used: {}; plan and approve it again", what));
}

PatientPosture PostureOf(std::string_view name) {
  if (const auto posture = Named<PatientPosture>(name)) return *posture;
  Fail(fmt::format("posture: expected HFS, HFP, FFS or FFP, found '{}'", name.substr(0, 20)));
}

double CheckedTolerance(std::string_view field, double value) {
  if (!(std::isfinite(value) && value > 0))
    Fail(fmt::format("{}: expected a number above 0, found {}", field, value));
  return value;
}

template <std::size_t N>
void CheckPoint(std::string_view field, const std::array<double, N>& point) {
  if (!std::all_of(point.begin(), point.end(), [](double v) { return std::isfinite(v); }))
    Fail(fmt::format("{}: expected finite metres", field));
}

}  // namespace

CompareOptions CompareOptionsFor(const ReferencePlan& plan, const CompareOptions& configured) {
  CompareOptions options = configured;
  if (!plan.region_m.empty() && plan.region_m.size() < 3)
    Fail(fmt::format("region_m: expected no corner or at least 3, found {}", plan.region_m.size()));
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
  options.limits.shift_tolerance_m =
      CheckedTolerance("shift_tolerance_mm", plan.tolerance.shift_mm) * kMillimetre;
  options.limits.rotation_tolerance_rad =
      CheckedTolerance("rotation_tolerance_deg", plan.tolerance.rotation_deg) * kDegree;
  return options;
}

}  // namespace plumb
