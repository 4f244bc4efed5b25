// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/ct_images.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

constexpr double kTissue_hu = 20.0, kLung_hu = -820.0, kShell_hu = -60.0, kFoam_hu = -930.0;
constexpr double kBeside_mm = 60.0, kMargin_mm = 15.0, kCouchThick_mm = 50.0, kShell_mm = 3.0;

/// In the plane of an image: x along its rows, y along its columns, which is down in the room.
using PlaneLoop = std::vector<Eigen::Vector2d>;

struct SliceLoops {
  std::vector<PlaneLoop> body, organ;
};

/// Signed distances of the pixels' centres from the edge of what loops enclose (even-odd), positive
/// inside; exact near the edge only.
class InsideOf {
 public:
  InsideOf(const CtImage& image, const Eigen::Vector2d& first, double near_mm)
      : columns_(image.columns),
        rows_(image.rows),
        pixel_(image.column_spacing_mm),
        first_(first),
        near_mm_(near_mm),
        distance_(image.hu.size(), static_cast<float>(near_mm)),
        is_inside_(image.hu.size(), 0) {}

  void Add(const PlaneLoop& loop) {
    for (std::size_t i = 0, j = loop.size() - 1; i < loop.size(); j = i++) {
      Fill(loop[j], loop[i]);
      Measure(loop[j], loop[i]);
    }
  }
  [[nodiscard]] double At(std::size_t i) const {
    return is_inside_[i] != 0 ? distance_[i] : -distance_[i];
  }

 private:
  [[nodiscard]] int ColumnOf(double x) const {
    return static_cast<int>(std::floor((x - first_.x()) / pixel_));
  }
  [[nodiscard]] int RowOf(double y) const {
    return static_cast<int>(std::floor((y - first_.y()) / pixel_));
  }
  [[nodiscard]] std::size_t Index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  // What lies to the right of an edge changes sides.
  void Fill(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const int from = std::max(0, RowOf(std::min(a.y(), b.y())));
    for (int row = from; row <= std::min(rows_ - 1, RowOf(std::max(a.y(), b.y()))); ++row) {
      const double y = first_.y() + row * pixel_;
      if ((a.y() > y) == (b.y() > y)) continue;
      const double x = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      for (int column = std::max(0, ColumnOf(x) + 1); column < columns_; ++column)
        is_inside_[Index(row, column)] ^= 1;
    }
  }

  void Measure(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    const Eigen::Vector2d low = a.cwiseMin(b), high = a.cwiseMax(b), along = b - a;
    const double length2 = std::max(along.squaredNorm(), 1e-12);
    const int last_row = std::min(rows_ - 1, RowOf(high.y() + near_mm_));
    const int last_column = std::min(columns_ - 1, ColumnOf(high.x() + near_mm_));
    for (int row = std::max(0, RowOf(low.y() - near_mm_)); row <= last_row; ++row) {
      for (int column = std::max(0, ColumnOf(low.x() - near_mm_)); column <= last_column;
           ++column) {
        const Eigen::Vector2d p = first_ + pixel_ * Eigen::Vector2d(column, row) - a;
        const double share = std::clamp(p.dot(along) / length2, 0.0, 1.0);
        float& distance = distance_[Index(row, column)];
        distance = std::min(distance, static_cast<float>((p - share * along).norm()));
      }
    }
  }

  int columns_, rows_;
  double pixel_;
  Eigen::Vector2d first_;
  double near_mm_;
  std::vector<float> distance_;
  std::vector<unsigned char> is_inside_;
};

PlaneLoop Box(double left, double top, double right, double bottom) {
  return {{left, top}, {right, top}, {right, bottom}, {left, bottom}};
}

class ImageMaker {
 public:
  ImageMaker(const StructureSet& structures, const PlanningCtOptions& options,
             const CtImageOptions& of_images)
      : of_images_(of_images), random_(Hash(47)) {
    image_.file = structures.file;
    image_.file.class_uid = "1.2.840.10008.5.1.4.1.1.2";
    image_.series_uid = "2.25.2";
    image_.position = std::string(Name(options.posture));
    image_.along_row = PatientOf(options.posture, Eigen::Vector3d::UnitX());
    image_.along_column = PatientOf(options.posture, -Eigen::Vector3d::UnitZ());
    image_.column_spacing_mm = image_.row_spacing_mm = of_images.pixel_mm;
    for (const PlannedRoi& roi : structures.rois) {
      for (const PlannedContour& contour : roi.contours) {
        // Contours of one slice may differ by a rounding.
        SliceLoops& slice = slices_[std::round(1e3 * contour.points_mm.front().z()) * 1e-3];
        if (contour.points_mm.size() < 3) continue;
        PlaneLoop& loop =
            (roi.name == "BODY" ? slice.body : slice.organ).emplace_back(InPlane(contour));
        if (roi.name == "BODY") Extend(loop);
      }
    }
    if (of_images.has_couch) {
      low_.x() -= kBeside_mm;
      high_.x() += kBeside_mm;
      couch_ = Box(low_.x(), high_.y(), high_.x(), high_.y() + kCouchThick_mm);
      foam_ = Box(low_.x() + kShell_mm, high_.y() + kShell_mm, high_.x() - kShell_mm,
                  high_.y() + kCouchThick_mm - kShell_mm);
      high_.y() += kCouchThick_mm;
    }
    first_ = low_ - Eigen::Vector2d::Constant(kMargin_mm);
    const Eigen::Vector2d sides =
        (high_ - first_ + Eigen::Vector2d::Constant(kMargin_mm)) / of_images.pixel_mm;
    image_.columns = static_cast<int>(sides.x()) + 1;
    image_.rows = static_cast<int>(sides.y()) + 1;
    image_.hu.resize(static_cast<std::size_t>(image_.rows) *
                     static_cast<std::size_t>(image_.columns));
  }

  void Make(const std::function<void(const CtImage&)>& visit) {
    int number = 0;
    for (const auto& [z_mm, slice] : slices_) {
      image_.file.instance_uid = "2.25.481.2." + std::to_string(++number);
      image_.origin_mm = first_.x() * image_.along_row + first_.y() * image_.along_column;
      image_.origin_mm.z() = z_mm;
      Paint(slice);
      visit(image_);
    }
  }

 private:
  [[nodiscard]] PlaneLoop InPlane(const PlannedContour& contour) const {
    PlaneLoop loop;
    for (const Eigen::Vector3d& p : contour.points_mm)
      loop.emplace_back(p.dot(image_.along_row), p.dot(image_.along_column));
    return loop;
  }

  void Extend(const PlaneLoop& loop) {
    for (const Eigen::Vector2d& p : loop) {
      low_ = low_.cwiseMin(p);
      high_ = high_.cwiseMax(p);
    }
  }

  void Paint(const SliceLoops& slice) {
    std::ranges::fill(image_.hu, static_cast<float>(kAir_hu));
    if (of_images_.has_couch) {
      PaintOne({couch_}, kShell_hu);
      PaintOne({foam_}, kFoam_hu);
    }
    PaintOne(slice.body, kTissue_hu);
    PaintOne(slice.organ, kLung_hu);
    for (float& hu : image_.hu) hu += static_cast<float>(of_images_.noise_hu * random_.Normal());
  }

  // An edge between two materials, blurred.
  void PaintOne(const std::vector<PlaneLoop>& loops, double hu) {
    InsideOf inside(image_, first_, 4 * of_images_.blur_mm);
    for (const PlaneLoop& loop : loops) inside.Add(loop);
    for (std::size_t i = 0; i < image_.hu.size(); ++i) {
      const double share = 0.5 * std::erfc(-inside.At(i) / (of_images_.blur_mm * std::sqrt(2.0)));
      image_.hu[i] = static_cast<float>((1 - share) * image_.hu[i] + share * hu);
    }
  }

  const CtImageOptions& of_images_;
  RandomStream random_;
  CtImage image_;
  std::map<double, SliceLoops> slices_;
  Eigen::Vector2d low_ = Eigen::Vector2d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector2d high_ = -low_, first_ = Eigen::Vector2d::Zero();
  PlaneLoop couch_, foam_;
};

}  // namespace

void MakeCtImages(const StructureSet& structures, const PlanningCtOptions& options,
                  const CtImageOptions& of_images,
                  const std::function<void(const CtImage&)>& visit) {
  ImageMaker(structures, options, of_images).Make(visit);
}

}  // namespace plumb::simulated
