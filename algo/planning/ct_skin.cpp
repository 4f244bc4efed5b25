// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/ct_skin.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "words/planning.hpp"

namespace plumb {
namespace {

constexpr double kAxial = 1e-3;  // of the directions' cosines: 0.5 mm over a body
constexpr double kMostPixel_mm = 5.0;
constexpr std::size_t kMostSkinPoints = 4'000'000;
// Noise, not parts of a body; a wrist has twenty times as much.
constexpr double kLeastPart_mm2 = 100.0;

/// An image within a border of air, so that every contour is closed.
class BorderedImage {
 public:
  BorderedImage(const CtImage& image, double threshold_hu)
      : image_(image),
        threshold_hu_(threshold_hu),
        width_(image.columns + 2),
        height_(image.rows + 2),
        hu_(Size(), static_cast<float>(kAir_hu)),
        is_inside_(Size(), 1) {
    for (int row = 0; row < image.rows; ++row)
      std::copy_n(image.hu.begin() + std::ptrdiff_t{row} * image.columns, image.columns,
                  hu_.begin() + std::ptrdiff_t{row + 1} * width_ + 1);
    Flood();
  }

  /// Calls visit(contour) for each, with points in the axes of the CT.
  template <typename Visit>
  void ForEachContour(const Visit& visit) {
    std::vector<std::int32_t> next = Linked();
    for (std::size_t start = 0; start < next.size(); ++start) {
      std::vector<Eigen::Vector3d> contour;
      auto at = static_cast<std::int32_t>(start);
      while (next[static_cast<std::size_t>(at)] >= 0) {
        contour.push_back(PointOn(at));
        at = std::exchange(next[static_cast<std::size_t>(at)], -1);
      }
      if (contour.size() >= 3) visit(std::move(contour));
    }
  }

  /// Changes of the image from one pixel to the next across the contours, HU per millimetre.
  [[nodiscard]] std::vector<double>& steps() { return steps_; }

 private:
  [[nodiscard]] std::size_t Size() const {
    return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  }

  // The air around the body. What it does not reach is inside.
  void Flood() {
    std::vector<std::size_t> open = {0};
    is_inside_[0] = 0;
    const auto width = static_cast<std::size_t>(width_);
    const auto reach = [&](std::size_t i) {
      if (is_inside_[i] == 0 || hu_[i] >= threshold_hu_) return;
      is_inside_[i] = 0;
      open.push_back(i);
    };
    while (!open.empty()) {
      const std::size_t i = open.back(), column = i % width;
      open.pop_back();
      if (column > 0) reach(i - 1);
      if (column + 1 < width) reach(i + 1);
      if (i >= width) reach(i - width);
      if (i + width < Size()) reach(i + width);
    }
  }

  // An edge between two neighbouring pixels: twice the first one's index, and 1 if the second is
  // below it. For each edge that a contour crosses the one that it crosses next, for others -1.
  [[nodiscard]] std::vector<std::int32_t> Linked() const {
    std::vector<std::int32_t> next(2 * Size(), -1);
    for (int row = 0; row + 1 < height_; ++row) {
      for (int column = 0; column + 1 < width_; ++column) {
        const std::int32_t a = row * width_ + column, b = a + 1, d = a + width_, c = d + 1;
        const std::array<bool, 4> inside = {Inside(a), Inside(b), Inside(c), Inside(d)};
        const std::array<std::int32_t, 4> edges = {2 * a, 2 * b + 1, 2 * d, 2 * a + 1};
        for (std::size_t k = 0; k < 4; ++k) {
          if (!inside[k] || inside[(k + 1) % 4]) continue;
          // Around this corner alone: pixels that touch by a corner only are apart.
          std::size_t from = k;
          while (inside[from]) from = (from + 3) % 4;
          next[static_cast<std::size_t>(edges[k])] = edges[from];
        }
      }
    }
    return next;
  }

  [[nodiscard]] bool Inside(std::int32_t pixel) const {
    return is_inside_[static_cast<std::size_t>(pixel)] != 0;
  }

  Eigen::Vector3d PointOn(std::int32_t edge) {
    const std::int32_t first = edge / 2, second = first + (edge % 2 == 0 ? 1 : width_);
    const double a = hu_[static_cast<std::size_t>(first)];
    const double b = hu_[static_cast<std::size_t>(second)];
    const double share = std::clamp((threshold_hu_ - a) / (b - a), 0.0, 1.0);
    steps_.push_back(std::abs(b - a) /
                     (edge % 2 == 0 ? image_.column_spacing_mm : image_.row_spacing_mm));
    const double column = first % width_ - 1 + (edge % 2 == 0 ? share : 0.0);
    const double row = first / width_ - 1 + (edge % 2 == 0 ? 0.0 : share);
    return image_.origin_mm + image_.along_row * (column * image_.column_spacing_mm) +
           image_.along_column * (row * image_.row_spacing_mm);
  }

  const CtImage& image_;
  const double threshold_hu_;
  const int width_, height_;
  std::vector<float> hu_;
  std::vector<std::uint8_t> is_inside_;
  std::vector<double> steps_;
};

double Area_mm2(const std::vector<Eigen::Vector3d>& contour) {
  double twice = 0.0;
  for (std::size_t i = 0, j = contour.size() - 1; i < contour.size(); j = i++)
    twice += contour[j].x() * contour[i].y() - contour[i].x() * contour[j].y();
  return std::abs(0.5 * twice);
}

bool IsAxial(const CtImage& image) {
  const auto along = [](const Eigen::Vector3d& direction, int axis) {
    return std::abs(std::abs(direction[axis]) - 1) < kAxial &&
           std::abs(direction.norm() - 1) < kAxial && std::abs(direction.z()) < kAxial;
  };
  return along(image.along_row, 0) && along(image.along_column, 1);
}

}  // namespace

CtSkin::CtSkin(double threshold_hu) : threshold_hu_(threshold_hu) {
  roi_.name = fmt::format("CT {:g} HU", threshold_hu);
}

void CtSkin::RequireSameSeries(const CtImage& image, const std::string& name) const {
  if (places_.empty()) return;
  if (image.file.patient_id != file_.patient_id || image.file.patient_name != file_.patient_name)
    throw DataError(say::planning::ImagesOtherPatient());
  if (image.series_uid != series_uid_ ||
      image.file.frame_of_reference_uid != file_.frame_of_reference_uid ||
      image.position != position_)
    throw DataError(say::planning::ImagesMixed(name, image.series_uid, series_uid_));
}

void CtSkin::Add(const CtImage& image, const std::string& name) {
  const double widest_mm = std::max(image.column_spacing_mm, image.row_spacing_mm);
  const double narrowest_mm = std::min(image.column_spacing_mm, image.row_spacing_mm);
  if (!(narrowest_mm > 0.05 && widest_mm <= kMostPixel_mm && image.rows > 0 && image.columns > 0 &&
        image.hu.size() ==
            static_cast<std::size_t>(image.rows) * static_cast<std::size_t>(image.columns)))
    throw DataError(say::planning::ImagePixels(name, widest_mm, kMostPixel_mm));
  if (!IsAxial(image)) throw DataError(say::planning::ImageTilted(name));
  RequireSameSeries(image, name);
  if (num_images() == kMostCtImages)
    throw DataError(say::planning::TooManyImages(static_cast<std::int64_t>(kMostCtImages)));
  if (!(image.origin_mm.cwiseAbs().maxCoeff() < 1e4) ||
      !places_.insert(std::llround(100 * image.origin_mm.z())).second)
    throw DataError(say::planning::ImageTwice(name, image.origin_mm.z()));
  series_uid_ = image.series_uid;
  position_ = image.position;
  file_ = image.file;
  roi_.frame_of_reference_uid = image.file.frame_of_reference_uid;
  pixel_mm_ = std::max(pixel_mm_, widest_mm);
  BorderedImage bordered(image, threshold_hu_);
  bordered.ForEachContour([&](std::vector<Eigen::Vector3d> contour) {
    if (Area_mm2(contour) < kLeastPart_mm2) return;
    // Exactly in the plane of the slice, although the directions may be off by a rounding.
    for (Eigen::Vector3d& p : contour) p.z() = image.origin_mm.z();
    num_points_ += contour.size();
    roi_.contours.push_back({.kind = "CLOSED_PLANAR", .points_mm = std::move(contour)});
  });
  if (num_points_ > kMostSkinPoints)
    throw DataError(say::planning::ImagesRagged(static_cast<std::int64_t>(kMostSkinPoints)));
  if (!bordered.steps().empty()) steepness_.push_back(TakeQuantile(bordered.steps(), 0.5));
}

double CtSkin::Steepness() const {
  std::vector<double> all = steepness_;
  return all.empty() ? 0.0 : TakeQuantile(all, 0.5);
}

}  // namespace plumb
