// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/depth_unit.hpp"

#include <array>
#include <cmath>
#include <vector>

#include "algo/base/statistics.hpp"
#include "algo/diagnosis/marker_depth.hpp"
#include "algo/markers/marker_detector.hpp"

namespace plumb {
namespace {

constexpr std::array kUnits = {1000.0, 5000.0};
constexpr std::int64_t kFramesRead = 120;  // 4 s; a sweep begins beside a marker, or meets one.
constexpr std::int64_t kEvery = 3;         // Frames of a sweep hardly differ from the next one.
constexpr std::size_t kEnoughFaces = 12, kLeastFaces = 4;
// Wrong prints and focal lengths are off by less, a wrong unit by much more.
constexpr double kNear = 0.3;
// Faces of the same unit agree within prints of two sizes.
constexpr double kAgree = 0.06;

}  // namespace

std::optional<double> DepthUnitByMarkers(FrameSource& source) {
  const StreamInfo& info = source.info();
  const std::optional<MarkerDictionary> dictionary =
      MarkerDictionary::Find(info.room_markers.dictionary);
  if (!dictionary || !(info.room_markers.length_m > 0) || !(info.depth_units_per_metre > 0))
    return std::nullopt;
  const MarkerDetector detector(*dictionary);
  std::vector<double> ratios;
  for (std::int64_t i = 0; i < kFramesRead && ratios.size() < kEnoughFaces; ++i) {
    const std::optional<Frame> frame = source.Next();
    if (!frame) break;
    if (i % kEvery != 0) continue;
    for (const MarkerObservation& marker : detector.Detect(frame->color_rgb).markers)
      if (const std::optional<double> ratio =
              DepthRatioOnFace(marker, frame->depth_m, info.intrinsics, info.room_markers.length_m))
        ratios.push_back(*ratio);
  }
  if (ratios.size() < kLeastFaces) return std::nullopt;
  const double common = TakeMedian(ratios);
  std::vector<double> apart;
  for (const double ratio : ratios) apart.push_back(std::abs(ratio / common - 1));
  if (TakeMedian(apart) > kAgree) return std::nullopt;
  for (const double unit : kUnits)
    if (std::abs(info.depth_units_per_metre * common / unit - 1) < kNear) return unit;
  return std::nullopt;
}

}  // namespace plumb
