// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/marker_detector.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/markers/corner_refinement.hpp"
#include "algo/markers/quad_finder.hpp"

namespace plumb {
namespace {

constexpr double kUnrefinedSigma_px = 0.7;  // corner of an outline on a blurred image

cv::Mat ToGray(const cv::Mat& image) {
  if (image.empty())
    throw std::invalid_argument(
        fmt::format("marker detection needs an image, got {} x {} pixels", image.cols, image.rows));
  if (image.type() == CV_8UC1) return image;
  if (image.type() != CV_8UC3) {
    throw std::invalid_argument(fmt::format(
        "marker detection needs 8 bits in 1 or 3 channels, got OpenCV type {}", image.type()));
  }
  cv::Mat gray;
  cv::cvtColor(image, gray, cv::COLOR_RGB2GRAY);
  return gray;
}

/// Adds a marker unless the same square is present (an outline and its inner rim may both decode).
/// Of two, the one with fewer wrong bits, then the larger one, is kept.
void AddDistinct(const DecodedMarker& marker, std::vector<DecodedMarker>& markers) {
  for (DecodedMarker& other : markers) {
    if (other.id != marker.id) continue;
    const double side = MeanSide(other.corners);
    double largest = 0;
    for (std::size_t k = 0; k < 4; ++k)
      largest = std::max(largest, (other.corners[k] - marker.corners[k]).norm());
    if (largest > 0.3 * side) continue;
    if (std::pair(marker.wrong_bits, -MeanSide(marker.corners)) <
        std::pair(other.wrong_bits, -side))
      other = marker;
    return;
  }
  markers.push_back(marker);
}

/// Sorts by id and removes ids that occur more than once.
MarkerDetection WithoutDuplicates(std::vector<MarkerObservation> found) {
  std::stable_sort(
      found.begin(), found.end(),
      [](const MarkerObservation& a, const MarkerObservation& b) { return a.id < b.id; });
  MarkerDetection result;
  for (std::size_t first = 0; first < found.size();) {
    std::size_t last = first + 1;
    while (last < found.size() && found[last].id == found[first].id) ++last;
    if (last - first == 1) {
      result.markers.push_back(found[first]);
    } else {
      result.duplicate_ids.push_back(found[first].id);
    }
    first = last;
  }
  return result;
}

constexpr double kExpectedWithin = 0.03;  // fraction of the image's width
// fraction of the image above which searching parts costs as much as searching all of it
constexpr double kMostOfImage = 0.7;

/// The parts of the image in which expected markers are searched; overlapping parts are merged.
std::vector<cv::Rect> PartsAround(const std::vector<ImageCorners>& expected, const cv::Size& size) {
  const cv::Rect image({0, 0}, size);
  const int margin =
      static_cast<int>(kExpectedWithin * size.width) + QuadFinderOptions().window_px / 2 + 1;
  std::vector<cv::Rect> parts;
  for (const ImageCorners& corners : expected) {
    Eigen::Vector2d low = corners[0], high = corners[0];
    for (const Eigen::Vector2d& corner : corners) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
    // Far outside the image a corner may have any value.
    low = low.cwiseMax(-size.width).cwiseMin(2 * size.width);
    high = high.cwiseMax(-size.width).cwiseMin(2 * size.width);
    const cv::Point first(static_cast<int>(low.x()) - margin, static_cast<int>(low.y()) - margin);
    const cv::Point end(static_cast<int>(high.x()) + margin, static_cast<int>(high.y()) + margin);
    cv::Rect part = cv::Rect(first, end) & image;
    if (part.empty()) continue;
    for (auto other = parts.begin(); other != parts.end();) {
      if ((*other & part).empty()) {
        ++other;
      } else {
        part |= *other;
        parts.erase(other);
        other = parts.begin();
      }
    }
    parts.push_back(part);
  }
  int area = 0;
  for (const cv::Rect& part : parts) area += part.area();
  if (area > kMostOfImage * image.area()) return {image};
  return parts;
}

}  // namespace

MarkerDetector::MarkerDetector(const MarkerDictionary& dictionary,
                               const MarkerDetectorOptions& options)
    : options_(options),
      dictionary_(dictionary),
      // Less than the dictionary's whole distance: allowing fewer wrong bits gives fewer false
      // markers.
      decoder_(dictionary, static_cast<int>(0.6 * dictionary.max_correction_bits())) {
  if (!(options.min_side_px >= 8))
    throw std::invalid_argument(
        fmt::format("min_side_px must be at least 8, got {}", options.min_side_px));
  if (!(options.border_px >= 0))
    throw std::invalid_argument(
        fmt::format("border_px must not be negative, got {}", options.border_px));
}

MarkerObservation MarkerDetector::Refined(const cv::Mat& gray, const DecodedMarker& marker) const {
  const MarkerPattern pattern{dictionary_.Code(marker.id), dictionary_.bits_per_side()};
  if (const auto refined = RefineCorners(gray, marker.corners, pattern))
    return {marker.id, refined->corners, refined->sigma_px};
  MarkerObservation observation{marker.id, marker.corners, {}};
  observation.sigma_px.fill(kUnrefinedSigma_px);
  return observation;
}

MarkerDetection MarkerDetector::DetectIn(const cv::Mat& gray,
                                         const std::vector<cv::Rect>& parts) const {
  std::vector<DecodedMarker> decoded;
  for (const cv::Rect& part : parts) {
    for (const ImageCorners& quad : FindDarkQuads(
             gray, part, {.min_side_px = options_.min_side_px, .border_px = options_.border_px})) {
      if (const std::optional<DecodedMarker> marker = decoder_.Decode(gray, quad))
        AddDistinct(*marker, decoded);
    }
  }
  std::vector<MarkerObservation> found;
  for (const DecodedMarker& marker : decoded) found.push_back(Refined(gray, marker));
  return WithoutDuplicates(std::move(found));
}

MarkerDetection MarkerDetector::Detect(const cv::Mat& gray_or_rgb) const {
  const cv::Mat gray = ToGray(gray_or_rgb);
  return DetectIn(gray, {{0, 0, gray.cols, gray.rows}});
}

MarkerDetection MarkerDetector::DetectNear(const cv::Mat& gray,
                                           const std::vector<ImageCorners>& expected) const {
  // Detect() reports what is wrong.
  if (gray.empty() || gray.type() != CV_8UC1) return Detect(gray);
  return DetectIn(gray, PartsAround(expected, gray.size()));
}

}  // namespace plumb
