// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/ct_skin.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/planning/contour_surface.hpp"
#include "words/planning.hpp"

namespace plumb {
namespace {

constexpr double kAxial = 1e-3;       // of the directions' cosines: 0.5 mm over a body
constexpr double kFarthest_mm = 1e4;  // of an image from the origin, along each axis
constexpr double kMostPixel_mm = 5.0;
constexpr double kPlacesPerMillimetre = 100.0;
constexpr std::size_t kMostSkinPoints = 4'000'000;
// Noise, not parts of a body; a wrist has twenty times as much.
constexpr double kLeastPart_mm2 = 100.0;

/// An image within a border of nothing, so that every contour is closed.
class BorderedImage {
 public:
  struct Contour {
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector3d> cuts;  ///< Those points beyond which nothing was measured.
  };

  BorderedImage(const CtImage& image, float threshold_hu)
      : image_(image),
        threshold_hu_(threshold_hu),
        width_(image.columns + 2),
        height_(image.rows + 2),
        hu_(Size(), static_cast<float>(kNothing_hu)),
        kinds_(Size(), kInside) {
    for (int row = 0; row < image.rows; ++row)
      std::copy_n(image.hu.begin() + std::ptrdiff_t{row} * image.columns, image.columns,
                  hu_.begin() + std::ptrdiff_t{row + 1} * width_ + 1);
    ClearSurroundings();
    CloseRow(1);
    CloseRow(image.rows);
    kinds_[0] = kBeyond;
    Flood(kBeyond, static_cast<float>(kLeastMeasured_hu));
    Flood(kAir, threshold_hu);
  }

  /// Calls visit(contour) for each, with points in the axes of the CT.
  template <typename Visit>
  void ForEachContour(const Visit& visit) {
    std::vector<std::int32_t> next = Linked();
    for (std::size_t start = 0; start < next.size(); ++start) {
      Contour contour;
      auto at = static_cast<std::int32_t>(start);
      while (next[static_cast<std::size_t>(at)] >= 0) {
        AddPoint(at, contour);
        at = std::exchange(next[static_cast<std::size_t>(at)], -1);
      }
      if (contour.points.size() >= 3) visit(std::move(contour));
    }
  }

  /// Changes of the image from one pixel to the next across the contours, HU per millimetre.
  [[nodiscard]] std::vector<double>& steps() { return steps_; }

 private:
  enum Kind : std::uint8_t { kInside, kBeyond, kAir };

  [[nodiscard]] std::size_t Size() const {
    return static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  }

  // Those of a round field of view have one value where no padding value marks them. The circle may
  // be a little smaller than the image.
  void ClearSurroundings() {
    constexpr double kRim = 0.97;
    constexpr auto kNothing = static_cast<float>(kNothing_hu);
    const float value = image_.hu.front();
    if (image_.rows != image_.columns || value >= threshold_hu_) return;
    const double middle = 0.5 * (width_ - 1), radius = 0.5 * image_.columns;
    std::vector<std::size_t> around;
    for (std::size_t i = 0; i < hu_.size(); ++i) {
      const auto width = static_cast<std::size_t>(width_);
      const double from_middle = std::hypot(static_cast<double>(i % width) - middle,
                                            static_cast<double>(i / width) - middle);
      if (hu_[i] == value && from_middle > kRim * radius)
        around.push_back(i);
      else if (hu_[i] != kNothing && from_middle > radius)
        return;
    }
    for (const std::size_t i : around) hu_[i] = kNothing;
  }

  // Where the first or the last row cuts the body it closes a lung, too, that is open there.
  void CloseRow(int row) {
    const auto from = hu_.begin() + std::ptrdiff_t{row} * width_, to = from + width_;
    const auto is_tissue = [&](float hu) { return hu >= threshold_hu_; };
    const auto first = std::find_if(from, to, is_tissue);
    const auto last =
        std::find_if(std::reverse_iterator(to), std::reverse_iterator(first), is_tissue);
    for (auto hu = first; hu < last.base(); ++hu) *hu = std::max(*hu, threshold_hu_);
  }

  // From everything that was reached before: what is darker and connected with it. What is never
  // reached is inside.
  void Flood(Kind kind, float below_hu) {
    std::vector<std::size_t> open;
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      if (kinds_[i] != kInside) open.push_back(i);
    const auto width = static_cast<std::size_t>(width_);
    const auto reach = [&](std::size_t i) {
      if (kinds_[i] != kInside || hu_[i] >= below_hu) return;
      kinds_[i] = kind;
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
    return kinds_[static_cast<std::size_t>(pixel)] == kInside;
  }

  void AddPoint(std::int32_t edge, Contour& contour) {
    const auto first = static_cast<std::size_t>(edge / 2);
    const std::size_t second = first + (edge % 2 == 0 ? 1 : static_cast<std::size_t>(width_));
    const double a = hu_[first], b = hu_[second];
    const bool is_cut = kinds_[first] == kBeyond || kinds_[second] == kBeyond;
    const double share = is_cut ? 0.5 : std::clamp((double{threshold_hu_} - a) / (b - a), 0.0, 1.0);
    const double column = edge / 2 % width_ - 1 + (edge % 2 == 0 ? share : 0.0);
    const double row = edge / 2 / width_ - 1 + (edge % 2 == 0 ? 0.0 : share);
    contour.points.emplace_back(image_.origin_mm +
                                image_.along_row * (column * image_.column_spacing_mm) +
                                image_.along_column * (row * image_.row_spacing_mm));
    if (is_cut)
      contour.cuts.push_back(contour.points.back());
    else
      steps_.push_back(std::abs(b - a) /
                       (edge % 2 == 0 ? image_.column_spacing_mm : image_.row_spacing_mm));
  }

  const CtImage& image_;
  const float threshold_hu_;
  const int width_, height_;
  std::vector<float> hu_;
  std::vector<Kind> kinds_;
  std::vector<double> steps_;
};

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
  const auto is_pixel = [](double side_mm) { return side_mm > 0.05 && side_mm <= kMostPixel_mm; };
  if (!(is_pixel(image.column_spacing_mm) && is_pixel(image.row_spacing_mm) && image.rows > 0 &&
        image.columns > 0 &&
        image.hu.size() ==
            static_cast<std::size_t>(image.rows) * static_cast<std::size_t>(image.columns)))
    throw DataError(say::planning::ImagePixels(name, widest_mm, kMostPixel_mm));
  if (!IsAxial(image)) throw DataError(say::planning::ImageTilted(name));
  RequireSameSeries(image, name);
  if (num_images() == kMostCtImages)
    throw DataError(say::planning::TooManyImages(static_cast<std::int64_t>(kMostCtImages)));
  if (!(image.origin_mm.cwiseAbs().maxCoeff() < kFarthest_mm))
    throw DataError(say::planning::ImageFarOff(name, kFarthest_mm));
  if (!places_.insert(std::llround(kPlacesPerMillimetre * image.origin_mm.z())).second)
    throw DataError(say::planning::ImageTwice(name, image.origin_mm.z()));
  series_uid_ = image.series_uid;
  instance_uids_.insert(image.file.instance_uid);
  position_ = image.position;
  file_ = image.file;
  roi_.frame_of_reference_uid = image.file.frame_of_reference_uid;
  pixel_mm_ = std::max(pixel_mm_, widest_mm);
  std::vector<Eigen::Vector3d> cuts_mm;
  BorderedImage bordered(image, static_cast<float>(threshold_hu_));
  bordered.ForEachContour([&](BorderedImage::Contour contour) {
    if (AreaOf(InPlane(contour.points)) < kLeastPart_mm2) return;
    // Exactly in the plane of the slice, although the directions may be off by a rounding.
    for (auto* points : {&contour.points, &contour.cuts})
      for (Eigen::Vector3d& p : *points) p.z() = image.origin_mm.z();
    num_points_ += contour.points.size();
    roi_.contours.push_back({.kind = "CLOSED_PLANAR", .points_mm = std::move(contour.points)});
    cuts_mm.insert(cuts_mm.end(), contour.cuts.begin(), contour.cuts.end());
  });
  if (!cuts_mm.empty()) cuts_mm_.push_back(std::move(cuts_mm));
  if (num_points_ > kMostSkinPoints)
    throw DataError(say::planning::ImagesRagged(static_cast<std::int64_t>(kMostSkinPoints)));
  if (!bordered.steps().empty()) steepness_.push_back(TakeQuantile(bordered.steps(), 0.5));
}

void CtSkin::RequireWhole() const {
  std::vector<double> steps;
  for (auto at = places_.begin(); at != places_.end() && std::next(at) != places_.end(); ++at)
    steps.push_back(static_cast<double>(*std::next(at) - *at) / kPlacesPerMillimetre);
  if (steps.empty()) return;
  std::vector<double> sorted = steps;
  const double usual = TakeQuantile(sorted, 0.5);
  const std::vector<bool> missing = MissingWithin(steps);
  const auto found = std::ranges::find(missing, true) - missing.begin();
  if (found == std::ssize(missing)) return;
  throw DataError(say::planning::ImagesMissing(
      static_cast<double>(*std::next(places_.begin(), found)) / kPlacesPerMillimetre,
      steps[static_cast<std::size_t>(found)], usual));
}

bool CtSkin::IsNamedBy(const StructureSet& structures) const {
  const auto found = structures.image_uids.find(series_uid_);
  return found != structures.image_uids.end() && !found->second.empty();
}

bool CtSkin::IsOfAnotherSeries(const StructureSet& structures) const {
  return !structures.image_uids.empty() && !structures.image_uids.contains(series_uid_);
}

void CtSkin::RequireNamed(const StructureSet& structures) const {
  const auto found = structures.image_uids.find(series_uid_);
  if (found == structures.image_uids.end()) return;
  const std::set<std::string> named(found->second.begin(), found->second.end());
  const auto missing = std::ranges::count_if(
      named, [this](const std::string& uid) { return !instance_uids_.contains(uid); });
  if (missing > 0) throw DataError(say::planning::ImagesNamedMissing(std::ssize(named), missing));
}

double CtSkin::Steepness() const {
  std::vector<double> all = steepness_;
  return all.empty() ? 0.0 : TakeQuantile(all, 0.5);
}

}  // namespace plumb
