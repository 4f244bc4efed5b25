// SPDX-License-Identifier: Apache-2.0
// The skin in the images of a CT, as contours such as a structure set has.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "algo/types/ct_image.hpp"

namespace plumb {

/// Tissue is brighter and air darker; about the edge that planning systems draw.
inline constexpr double kSkinThreshold_hu = -300.0;
/// What a person may choose.
inline constexpr double kLeastSkinThreshold_hu = -900.0, kMostSkinThreshold_hu = 0.0;
/// More images are refused.
inline constexpr std::size_t kMostCtImages = 2000;

/// Takes one image after the other, of which only the contours stay: what air cannot reach from the
/// image's edge is inside, so that lungs are no holes; what the edge of the image, or of its
/// measured pixels, cuts is closed along it, and the cuts are noted. The couch is still part of it
/// (see couch_top.hpp).
class CtSkin {
 public:
  explicit CtSkin(double threshold_hu = kSkinThreshold_hu);

  /// @param name  What messages call it.
  /// @throws DataError for an image of another series, frame or patient than those before, at the
  ///         place of one of them, or that is not axial.
  void Add(const CtImage& image, const std::string& name);

  /// @throws DataError if one is missing between others: the series was not sent as a whole.
  void RequireWhole() const;

  /// Whether the structure set names images of this series.
  [[nodiscard]] bool IsNamedBy(const StructureSet& structures) const;
  /// Whether it names images, and none of this series.
  [[nodiscard]] bool IsOfAnotherSeries(const StructureSet& structures) const;
  /// @throws DataError if one that it names is missing, which may be at an end.
  void RequireNamed(const StructureSet& structures) const;

  [[nodiscard]] std::size_t num_images() const { return places_.size(); }
  [[nodiscard]] double threshold_hu() const { return threshold_hu_; }
  /// Its name states the threshold.
  [[nodiscard]] const PlannedRoi& roi() const { return roi_; }
  /// Of each image that ends within something: the points of its contours that lie at that edge.
  [[nodiscard]] const std::vector<std::vector<Eigen::Vector3d>>& cuts_mm() const {
    return cuts_mm_;
  }
  [[nodiscard]] const PlanningFile& file() const { return file_; }
  [[nodiscard]] const std::string& position() const { return position_; }
  [[nodiscard]] double pixel_mm() const { return pixel_mm_; }
  /// How much the images change across the skin: the median, HU per millimetre; 0 without any.
  [[nodiscard]] double Steepness() const;

 private:
  void RequireSameSeries(const CtImage& image, const std::string& name) const;

  double threshold_hu_;
  PlannedRoi roi_;
  std::vector<std::vector<Eigen::Vector3d>> cuts_mm_;
  PlanningFile file_;
  std::string series_uid_, position_;
  std::set<std::string> instance_uids_;
  double pixel_mm_ = 0.0;
  std::size_t num_points_ = 0;
  std::set<std::int64_t> places_;  // along the body, in hundredths of a millimetre
  std::vector<double> steepness_;  // of each image
};

}  // namespace plumb
