// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/rest_detector.hpp"

#include <utility>

#include "algo/types/marker_dictionary.hpp"

namespace plumb {
namespace {

constexpr std::size_t kLeastSeen = 4;  // markers, as PlaceByMarkers() needs them
constexpr double kRest_s = 2.0;
constexpr double kLongestWithoutLook_s = 1.0;
// Mean shift of the corners, at 640 columns. Of a simulated sensor at rest (640x480) it was at most
// 0.012 px in 58 looks; a hand that holds still sways by more than a millimetre, 0.5 px at a metre.
constexpr double kStill_px = 0.3;

/// Nothing with too few markers in common.
std::optional<double> MeanShift_px(const SeenCorners& before, const SeenCorners& now) {
  double sum = 0;
  std::size_t markers = 0;
  for (const auto& [id, corners] : now) {
    const auto known = before.find(id);
    if (known == before.end()) continue;
    ++markers;
    for (std::size_t c = 0; c < corners.size(); ++c) sum += (corners[c] - known->second[c]).norm();
  }
  if (markers < kLeastSeen) return std::nullopt;
  return sum / (4.0 * static_cast<double>(markers));
}

}  // namespace

RestDetector::RestDetector(const Scene& scene, const Intrinsics& camera)
    : scene_(scene.markers),
      detector_(MarkerDictionary::ByName(scene.room_markers.dictionary)),
      limit_px_(kStill_px * camera.width / 640.0) {}

bool RestDetector::Add(double time_s, const cv::Mat& color) {
  SeenCorners seen;
  for (const MarkerObservation& marker : detector_.Detect(color).markers)
    seen.emplace(marker.id, marker.corners);
  return Add(time_s, seen);
}

bool RestDetector::Add(double time_s, const SeenCorners& seen) {
  SeenCorners known;
  for (const auto& [id, corners] : seen)
    if (scene_.contains(id)) known.emplace(id, corners);
  const bool goes_on = last_s_ && time_s - *last_s_ <= kLongestWithoutLook_s && known != last_;
  last_s_ = time_s;
  last_ = known;
  const std::optional<double> shift = MeanShift_px(start_, known);
  if (!goes_on || !shift || *shift > limit_px_) Restart(time_s, std::move(known));
  return since_s_ && time_s - *since_s_ >= kRest_s;
}

void RestDetector::Restart(double time_s, SeenCorners known) {
  since_s_.reset();
  if (known.size() >= kLeastSeen) since_s_ = time_s;
  start_ = std::move(known);
}

}  // namespace plumb
