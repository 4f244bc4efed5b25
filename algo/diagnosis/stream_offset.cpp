// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/stream_offset.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <opencv2/imgproc.hpp>

#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr int kSmallWidth = 96;
constexpr double kLargestOffset_s = 0.6;
constexpr double kLagStep_s = 0.005;
constexpr std::size_t kLeastRates = 30;  // About two seconds at 15 images a second.
// Correlation of the two motions at the best offset. Recordings whose streams belong together have
// 0.8 to 0.99.
constexpr double kLeastCorrelation = 0.6;
// A steady motion correlates at every offset.
constexpr double kLeastPeak = 0.02;

cv::Size SmallSize(const cv::Mat& image) {
  return {kSmallWidth, std::max(16, image.rows * kSmallWidth / std::max(1, image.cols))};
}

// The rate at a time, between two measured ones; none across a gap.
std::optional<Eigen::Vector2d> RateAt(const std::vector<ImageMotion::Rate>& rates, double time_s,
                                      double longest_s) {
  const auto next =
      std::ranges::lower_bound(rates, time_s, {}, [](const auto& rate) { return rate.time_s; });
  if (next == rates.begin() || next == rates.end()) return std::nullopt;
  const auto last = next - 1;
  const double step_s = next->time_s - last->time_s;
  if (!(step_s > 0) || step_s > longest_s) return std::nullopt;
  const double part = (time_s - last->time_s) / step_s;
  return Eigen::Vector2d((1 - part) * last->px_per_s + part * next->px_per_s);
}

struct Correlation {
  double value = -1.0;
  std::size_t count = 0;
};

Correlation CorrelationAt(const std::vector<ImageMotion::Rate>& color,
                          const std::vector<ImageMotion::Rate>& depth, double lag_s,
                          double longest_s) {
  double sum_cc = 0, sum_dd = 0, sum_cd = 0;
  Eigen::Vector2d sum_c = Eigen::Vector2d::Zero(), sum_d = Eigen::Vector2d::Zero();
  Correlation found;
  for (const ImageMotion::Rate& rate : color) {
    const auto other = RateAt(depth, rate.time_s + lag_s, longest_s);
    if (!other) continue;
    sum_cc += rate.px_per_s.squaredNorm();
    sum_dd += other->squaredNorm();
    sum_cd += rate.px_per_s.dot(*other);
    sum_c += rate.px_per_s;
    sum_d += *other;
    ++found.count;
  }
  if (found.count < kLeastRates) return found;
  const auto n = static_cast<double>(found.count);
  const double cc = sum_cc - sum_c.squaredNorm() / n, dd = sum_dd - sum_d.squaredNorm() / n;
  if (cc > 0 && dd > 0) found.value = (sum_cd - sum_c.dot(sum_d) / n) / std::sqrt(cc * dd);
  return found;
}

}  // namespace

void ImageMotion::AddColor(const cv::Mat& image, double time_s) {
  cv::Mat small, gray;
  cv::resize(image, small, SmallSize(image), 0, 0, cv::INTER_AREA);
  if (small.channels() == 3) {
    cv::cvtColor(small, gray, cv::COLOR_RGB2GRAY);
  } else {
    gray = small;
  }
  cv::Mat values;
  gray.convertTo(values, CV_32F, 1.0 / 255);
  Add(values, time_s);
}

void ImageMotion::AddDepth(const cv::Mat& depth_m, double time_s) {
  cv::Mat small;
  cv::resize(depth_m, small, SmallSize(depth_m), 0, 0, cv::INTER_NEAREST);
  // Holes get the median, so that they make no edges of their own.
  std::vector<float> valid;
  for (int r = 0; r < small.rows; ++r)
    for (int c = 0; c < small.cols; ++c)
      if (const float z = small.at<float>(r, c); z > 0) valid.push_back(z);
  if (valid.empty()) return;
  const float median = TakeMedian(valid);
  for (int r = 0; r < small.rows; ++r)
    for (int c = 0; c < small.cols; ++c)
      if (float& z = small.at<float>(r, c); !(z > 0)) z = median;
  cv::Mat inverse = 1.0 / small;
  Add(inverse, time_s);
}

void ImageMotion::Add(const cv::Mat& small, double time_s) {
  if (window_.size() != small.size()) {
    cv::createHanningWindow(window_, small.size(), CV_32F);
    previous_.release();
  }
  const double step_s = time_s - previous_time_s_;
  if (!previous_.empty() && step_s > 0) {
    const cv::Point2d moved = cv::phaseCorrelate(previous_, small, window_);
    rates_.push_back({time_s - 0.5 * step_s, Eigen::Vector2d(moved.x, moved.y) / step_s});
  }
  previous_ = small;
  previous_time_s_ = time_s;
}

double ImageMotion::MedianWidthsPerSecond() const {
  std::vector<double> speeds;
  for (const Rate& rate : rates_) speeds.push_back(rate.px_per_s.norm() / kSmallWidth);
  return speeds.empty() ? 0.0 : TakeMedian(speeds);
}

std::optional<StreamOffset> EstimateStreamOffset(const std::vector<ImageMotion::Rate>& color,
                                                 const std::vector<ImageMotion::Rate>& depth) {
  if (color.size() < kLeastRates || depth.size() < kLeastRates) return std::nullopt;
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < depth.size(); ++i)
    steps_s.push_back(depth[i].time_s - depth[i - 1].time_s);
  const double longest_s = 2.5 * TakeMedian(steps_s);
  constexpr int kLags = static_cast<int>(kLargestOffset_s / kLagStep_s + 0.5);
  std::vector<Correlation> at;
  for (int lag = -kLags; lag <= kLags; ++lag)
    at.push_back(CorrelationAt(color, depth, lag * kLagStep_s, longest_s));
  const auto best = std::ranges::max_element(at, {}, &Correlation::value);
  const auto index = static_cast<int>(best - at.begin());
  constexpr int kLeastReach = 2;
  const int room = std::min(index, 2 * kLags - index);
  if (best->value < kLeastCorrelation || room < kLeastReach) return std::nullopt;
  // A parabola through the values about two frames around, since the peak is as wide as that.
  const int reach = std::clamp(static_cast<int>(0.4 * longest_s / kLagStep_s), kLeastReach, room);
  const auto value = [&](int i) { return at[static_cast<std::size_t>(i)].value; };
  const double left = value(index - reach), right = value(index + reach);
  const double bend = left + right - 2 * best->value;
  if (!(bend < -kLeastPeak)) return std::nullopt;
  const double shift = std::clamp(0.5 * (left - right) / bend, -1.0, 1.0);
  const double width_s = reach * kLagStep_s;
  const double curvature = -bend / (width_s * width_s);  // For a second, squared.
  const auto count = static_cast<double>(best->count);
  return StreamOffset{(index - kLags) * kLagStep_s + shift * width_s,
                      std::sqrt((1 - best->value * best->value) / (count * curvature))};
}

}  // namespace plumb
