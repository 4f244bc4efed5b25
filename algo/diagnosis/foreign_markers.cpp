// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/foreign_markers.hpp"

#include <map>
#include <vector>

#include <opencv2/imgproc.hpp>

#include "algo/markers/marker_detector.hpp"

namespace plumb {
namespace {

// Number of times that a marker was decoded which another image showed too. A chance decoding of a
// small dictionary's code does not repeat.
int RepeatedDecodings(std::span<const cv::Mat> grays, const MarkerDictionary& dictionary) {
  const MarkerDetector detector(dictionary);
  std::map<int, int> seen;
  for (const cv::Mat& gray : grays)
    for (const MarkerObservation& marker : detector.Detect(gray).markers) ++seen[marker.id];
  int repeated = 0;
  for (const auto& [id, count] : seen) repeated += count > 1 ? count : 0;
  return repeated;
}

}  // namespace

std::optional<ForeignMarkers> FindForeignMarkers(std::span<const cv::Mat> images,
                                                 const MarkerDictionary& dictionary) {
  using Kind = ForeignMarkers::Kind;
  std::vector<cv::Mat> upright, mirrored, inverted;
  for (const cv::Mat& image : images) {
    cv::Mat gray = image, flipped;
    if (image.channels() == 3) cv::cvtColor(image, gray, cv::COLOR_RGB2GRAY);
    cv::flip(gray, flipped, 1);
    upright.push_back(gray);
    mirrored.push_back(flipped);
    inverted.push_back(255 - gray);
  }
  std::optional<ForeignMarkers> best;
  // What the room's own dictionary decodes is no foreign marker.
  int most = RepeatedDecodings(upright, dictionary);
  const auto consider = [&](int decodings, Kind kind, const std::string& name) {
    if (decodings <= most) return;
    most = decodings;
    best = ForeignMarkers{kind, name};
  };
  consider(RepeatedDecodings(mirrored, dictionary), Kind::kMirrored, dictionary.name());
  consider(RepeatedDecodings(inverted, dictionary), Kind::kInverted, dictionary.name());
  // The known names go from the smallest dictionary of a family to the largest, so that the
  // smallest that holds all codes is named.
  for (const std::string& name : MarkerDictionary::KnownNames())
    if (name != dictionary.name())
      consider(RepeatedDecodings(upright, MarkerDictionary::ByName(name)), Kind::kOtherDictionary,
               name);
  return best;
}

}  // namespace plumb
