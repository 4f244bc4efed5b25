#include "algo/markers/marker_detector.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/markers/corner_refinement.hpp"
#include "algo/markers/marker_decoder.hpp"
#include "algo/markers/quad_finder.hpp"

namespace plumb {
namespace {

constexpr double kUnrefinedSigma_px = 0.7;  // an outline's corner on a blurred image

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

double MeanSide(const ImageCorners& corners) {
  double sum = 0;
  for (std::size_t i = 0; i < 4; ++i) sum += (corners[(i + 1) % 4] - corners[i]).norm();
  return sum / 4;
}

/// Adds a marker unless the same square is there already (an outline and its inner rim may both
/// decode): the one with fewer wrong bits, then the larger one, stays.
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

/// Sorts by id and takes out ids that occur more than once.
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

}  // namespace

struct MarkerDetector::Impl {
  MarkerDetectorOptions options;
  MarkerDictionary dictionary;
  MarkerDecoder decoder;

  [[nodiscard]] MarkerObservation Refined(const cv::Mat& gray, const DecodedMarker& marker) const {
    MarkerObservation observation;
    observation.id = marker.id;
    observation.corners = marker.corners;
    observation.sigma_px.fill(kUnrefinedSigma_px);
    if (!options.refine_corners) return observation;
    const MarkerPattern pattern{dictionary.Code(marker.id), dictionary.bits_per_side()};
    CornerRefinementOptions refinement;
    refinement.linear_light = options.linear_light;
    refinement.intrinsics = options.intrinsics;
    if (const auto refined = RefineCorners(gray, marker.corners, pattern, refinement)) {
      observation.corners = refined->corners;
      observation.sigma_px = refined->sigma_px;
    }
    return observation;
  }
};

MarkerDetector::MarkerDetector(const MarkerDictionary& dictionary,
                               const MarkerDetectorOptions& options) {
  if (!(options.min_side_px >= 8))
    throw std::invalid_argument(
        fmt::format("min_side_px must be at least 8, got {}", options.min_side_px));
  if (!(options.border_px >= 0))
    throw std::invalid_argument(
        fmt::format("border_px must not be negative, got {}", options.border_px));
  // Not the whole of the dictionary's distance: fewer wrong bits, fewer false markers.
  const int max_wrong_bits = static_cast<int>(0.6 * dictionary.max_correction_bits());
  impl_.reset(new Impl{options, dictionary, MarkerDecoder(dictionary, max_wrong_bits)});
}

MarkerDetector::~MarkerDetector() = default;
MarkerDetector::MarkerDetector(MarkerDetector&&) noexcept = default;
MarkerDetector& MarkerDetector::operator=(MarkerDetector&&) noexcept = default;

MarkerDetection MarkerDetector::Detect(const cv::Mat& gray_or_rgb) const {
  const cv::Mat gray = ToGray(gray_or_rgb);
  const MarkerDetectorOptions& options = impl_->options;
  std::vector<DecodedMarker> decoded;
  for (const ImageCorners& quad :
       FindDarkQuads(gray, {.min_side_px = options.min_side_px, .border_px = options.border_px})) {
    if (const std::optional<DecodedMarker> marker = impl_->decoder.Decode(gray, quad))
      AddDistinct(*marker, decoded);
  }
  std::vector<MarkerObservation> found;
  for (const DecodedMarker& marker : decoded) found.push_back(impl_->Refined(gray, marker));
  return WithoutDuplicates(std::move(found));
}

}  // namespace plumb
