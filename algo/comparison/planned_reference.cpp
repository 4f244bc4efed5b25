// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/planned_reference.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "algo/base/units.hpp"
#include "algo/motion/surface_patterns.hpp"
#include "words/comparison.hpp"

namespace plumb {
namespace {

constexpr double kSideTolerance = 0.03;
constexpr double kMostCornerSigma_m = 5 * kMillimetre;
// The frame of one marker in the map of its own scan, beyond the noise of its corners: the bow of
// the map between the markers and of the print. Measured on 30 sweeps of three units: 0.03 to 0.2
// deg about all axes together.
constexpr double kFrameTilt_rad = 0.06 * kDegree;
constexpr double kFrameShift_m = 0.3 * kMillimetre;

bool IsGood(const SceneMarker& marker, double length_m) {
  const bool finite = std::all_of(marker.corners.begin(), marker.corners.end(),
                                  [](const Eigen::Vector3d& p) { return p.allFinite(); });
  return finite && marker.num_views != 1 && marker.sigma_m <= kMostCornerSigma_m &&
         std::abs(MeanSide(marker.corners) - length_m) <= kSideTolerance * length_m;
}

// An alignment in another frame.
Alignment Carried(const Pose& T_to_from, Alignment alignment) {
  const Eigen::Matrix3d R = T_to_from.linear();
  alignment.T_reference_current = T_to_from * alignment.T_reference_current;
  alignment.stretch = R * alignment.stretch * R.transpose();
  alignment.distortion = R * alignment.distortion * R.transpose();
  alignment.covariance = CovarianceTurned(alignment.covariance, R);
  alignment.centre_m = T_to_from * alignment.centre_m;
  return alignment;
}

void PlaceByTaught(const Scene& scan, const CalibratedRoom& room, Preset preset,
                   const MarkerConsensusOptions& options, int min_markers, PlacedScan& result) {
  AlignmentOutcome outcome = AlignScenes(room.markers, scan.markers, preset, options, min_markers);
  result.markers = std::move(outcome.markers);
  result.warnings.insert(result.warnings.end(), outcome.warnings.begin(), outcome.warnings.end());
  if (outcome.alignment) {
    result.alignment = Carried(*room.T_iec_reference, *std::move(outcome.alignment));
    result.uncertainty.origin_m = result.alignment->centre_m;
    return;
  }
  const std::vector<Message> refusals = RefusalsOfMarkers(result.markers, min_markers);
  result.failure = refusals.empty() ? say::comparison::NoAlignment() : refusals.front();
}

void PlaceByReferenceMarker(const Scene& scan, const CalibratedRoom& room, int min_markers,
                            PlacedScan& result) {
  const double length_m = scan.room_markers.length_m;
  Alignment alignment;
  for (const auto& [id, marker] : scan.markers) {
    if (IsGood(marker, length_m)) alignment.markers_used.push_back(id);
  }
  result.markers.shared_ids = alignment.markers_used;
  result.markers.good = static_cast<int>(alignment.markers_used.size());
  if (result.markers.good < min_markers) {
    result.failure = say::comparison::FewMarkersForRoom(min_markers, result.markers.good);
    return;
  }
  alignment.rms_m = std::numeric_limits<double>::quiet_NaN();
  alignment.T_reference_current = *room.T_iec_reference;
  alignment.centre_m = room.T_iec_reference->translation();
  double sigma_m = kMostCornerSigma_m;
  const std::optional<int> id = scan.room_markers.reference;
  if (const auto found = id ? scan.markers.find(*id) : scan.markers.end();
      found != scan.markers.end())
    sigma_m = found->second.sigma_m;
  result.uncertainty.origin_m = alignment.centre_m;
  result.uncertainty.frame_sigma_m = std::hypot(0.5 * sigma_m, kFrameShift_m);
  result.uncertainty.frame_sigma_rad = std::hypot(0.25 * sigma_m / length_m, kFrameTilt_rad);
  result.warnings.push_back(say::comparison::OneMarkerForPlan());
  result.alignment = std::move(alignment);
}

}  // namespace

PlacedScan PlaceInRoom(const Scene& scan, const CalibratedRoom& room, Preset preset,
                       const MarkerConsensusOptions& options, int min_markers) {
  PlacedScan result;
  if (!room.T_iec_reference) {
    result.failure = room.why_not.empty() ? say::comparison::RoomNotCalibrated() : room.why_not;
    return result;
  }
  if (!room.markers.empty()) {
    PlaceByTaught(scan, room, preset, options, min_markers, result);
  } else if (scan.frame != SceneFrame::kReferenceMarker) {
    result.failure = say::comparison::WithoutReferenceMarker();
  } else {
    PlaceByReferenceMarker(scan, room, min_markers, result);
  }
  if (!room.u95_m || !room.u95_rad) result.warnings.push_back(say::comparison::RoomTakenAsExact());
  result.uncertainty.room_u95_m = std::hypot(room.u95_m.value_or(0.0), room.calibration_u95_m);
  result.uncertainty.room_u95_rad =
      std::hypot(room.u95_rad.value_or(0.0), room.calibration_u95_rad);
  return result;
}

Alignment AlignAcrossRooms(const Alignment& reference, const Alignment& current) {
  const Pose T_reference_iec = reference.T_reference_current.inverse();
  const Alignment own = Carried(T_reference_iec, reference);
  Alignment across = Carried(T_reference_iec, current);
  across.stretch = own.stretch.inverse() * across.stretch;
  across.covariance += CovarianceAbout(own.covariance, own.centre_m, across.centre_m);
  across.distortion += own.distortion;
  across.rms_m = std::hypot(across.rms_m, own.rms_m);
  across.stretch_sigma = std::hypot(across.stretch_sigma, own.stretch_sigma);
  return across;
}

FeignedMotions FeignedBy(const PointCloud& cloud,
                         const std::function<bool(const Eigen::Vector3d&)>& in_region,
                         const Pose& T_motion, const Eigen::Vector3d& moved_m) {
  const auto [out, out_along, out_across, up, up_along] =
      MotionsOfPatterns(cloud, in_region, T_motion, moved_m);
  return {.skin = out, .clothing = {out, out_along, out_across}, .breathing = {up, up_along}};
}

}  // namespace plumb
