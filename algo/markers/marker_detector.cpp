#include "algo/markers/marker_detector.hpp"

#include <algorithm>
#include <opencv2/aruco.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include <fmt/format.h>

namespace plumb {
namespace {

cv::Ptr<cv::aruco::Dictionary> ToOpenCv(const MarkerDictionary& dictionary) {
  const int bits = dictionary.bits_per_side();
  cv::Mat all_bytes;
  for (int id = 0; id < dictionary.size(); ++id) {
    cv::Mat pattern(bits, bits, CV_8UC1);
    for (int row = 0; row < bits; ++row)
      for (int column = 0; column < bits; ++column) pattern.at<std::uint8_t>(row, column) = dictionary.Bit(id, row, column) ? 1 : 0;
    all_bytes.push_back(cv::aruco::Dictionary::getByteListFromBits(pattern));
  }
  return cv::makePtr<cv::aruco::Dictionary>(all_bytes, bits, dictionary.max_correction_bits());
}

cv::Mat ToGray(const cv::Mat& image) {
  if (image.empty())
    throw std::invalid_argument(fmt::format("marker detection needs an image, got {} x {} pixels", image.cols, image.rows));
  if (image.type() == CV_8UC1) return image;
  if (image.type() != CV_8UC3) {
    throw std::invalid_argument(fmt::format("marker detection needs 8 bits in 1 or 3 channels, got OpenCV type {}", image.type()));
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

/// Sorts by id and takes out ids that occur more than once.
MarkerDetection WithoutDuplicates(std::vector<MarkerObservation> found) {
  std::stable_sort(found.begin(), found.end(), [](const MarkerObservation& a, const MarkerObservation& b) { return a.id < b.id; });
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
  cv::Ptr<cv::aruco::Dictionary> dictionary;
  cv::Ptr<cv::aruco::DetectorParameters> parameters;
};

MarkerDetector::MarkerDetector(const MarkerDictionary& dictionary, const MarkerDetectorOptions& options) : impl_(std::make_unique<Impl>()) {
  if (!(options.min_side_px >= 8)) throw std::invalid_argument(fmt::format("min_side_px must be at least 8, got {}", options.min_side_px));
  if (!(options.border_px >= 0)) throw std::invalid_argument(fmt::format("border_px must not be negative, got {}", options.border_px));
  impl_->options = options;
  impl_->dictionary = ToOpenCv(dictionary);
  impl_->parameters = cv::aruco::DetectorParameters::create();
  if (options.refine_corners) impl_->parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
}

MarkerDetector::~MarkerDetector() = default;
MarkerDetector::MarkerDetector(MarkerDetector&&) noexcept = default;
MarkerDetector& MarkerDetector::operator=(MarkerDetector&&) noexcept = default;

MarkerDetection MarkerDetector::Detect(const cv::Mat& gray_or_rgb) const {
  const cv::Mat gray = ToGray(gray_or_rgb);
  std::vector<std::vector<cv::Point2f>> quads;
  std::vector<int> ids;
  cv::aruco::detectMarkers(gray, impl_->dictionary, quads, ids, impl_->parameters);

  std::vector<MarkerObservation> found;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    MarkerObservation marker;
    marker.id = ids[i];
    for (std::size_t k = 0; k < 4; ++k) marker.corners[k] = Eigen::Vector2d(quads[i][k].x, quads[i][k].y);
    if (MeanSide(marker.corners) >= impl_->options.min_side_px) found.push_back(marker);
  }
  return WithoutDuplicates(std::move(found));
}

}  // namespace plumb
