// SPDX-License-Identifier: Apache-2.0
// A surface as a camera above sees it, from the contours of its slices.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>

#include "algo/base/units.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

/// A closed contour in the plane of its slice; metres, x to the right and z up.
using FlatContour = std::vector<Eigen::Vector2d>;

struct ContourSlice {
  double y_m = 0.0;  ///< Place of the slice.
  std::vector<FlatContour> contours;
  /// Points at which the images end and the body may not. What lies within 15 mm of one, across
  /// and in height, is no part of the surface.
  std::vector<Eigen::Vector2d> cuts = {};
};

struct ContourSurfaceOptions {
  double step_m = 2 * kMillimetre;
  double min_area_m2 = 100e-6;                ///< Smaller contours are crumbs.
  double max_step_m = 10 * kMillimetre;       ///< Between neighbouring cells: more is a flank.
  double max_spacing_m = 6 * kMillimetre;     ///< Of slices between which heights are interpolated.
  double above_support_m = 15 * kMillimetre;  ///< What is lower may be the couch.
  /// A side that is straight and vertical over this height, in one column of many slices, is the
  /// edge of the CT's field of view.
  double straight_side_m = 60 * kMillimetre;
};

struct ContourSurface {
  HeightMap heights;  ///< z over x and y; cells that are no sure part of the surface are empty.
  double support_m = 0.0;       ///< Height of what the body lies on.
  double spacing_m = 0.0;       ///< The usual one of the slices.
  std::size_t parts_apart = 0;  ///< Contours beside the largest of their slice that were kept.
  std::size_t crumbs = 0;       ///< Contours that are too small.
  std::size_t repeated = 0;     ///< Contours that the same slice has once more.
  std::size_t couch_parts = 0;  ///< Parts apart that do not rise above the height of the couch.
  std::size_t holes = 0;        ///< Contours inside another one.
  std::size_t gaps = 0;        ///< Steps that are left empty: slices are missing, or too far apart.
  bool cut_at_side = false;    ///< Arms or shoulders end at the edge of the field of view.
  std::size_t cut_slices = 0;  ///< Slices whose cuts took a part of the surface.
};

/// Contours with more parts in a slice, more slices or more to and fro than outlines of a body
/// have: they would take all memory, or minutes.
struct RaggedContours : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// One slice for each place (to 0.01 mm), in their order.
[[nodiscard]] std::vector<ContourSlice> Joined(std::vector<ContourSlice> slices);

/// For each step from a place to the next whether slices are missing within it: where one to three
/// in a row are more than 1.5 times as long as those on both sides; at an end of the scan one. More
/// of them are another spacing, which a scan may have beyond what is treated.
[[nodiscard]] std::vector<bool> MissingWithin(const std::vector<double>& steps);

/// Each column of each slice takes its topmost crossing by the even-odd rule, so that holes and
/// keyholes need no care (a contour that a slice has twice counts once), and rows between
/// neighbouring slices are interpolated. Empty remain: the first and the last slice, which are the
/// ends of the scan; rows in a gap; steps; what is not higher than the couch; the field of view's
/// edges; and what lies beside a cut.
/// @param slices  In any order. Those at one place (to 0.01 mm) are joined.
/// @throws RaggedContours with more than 10,000 places, 500 parts in a slice, or 50 crossings of a
///         slice's columns in the mean; std::invalid_argument with fewer than three places, or none
///         with an area.
[[nodiscard]] ContourSurface SurfaceFromAbove(std::vector<ContourSlice> slices,
                                              const ContourSurfaceOptions& options = {});

/// Points of one slice without their place along the body.
[[nodiscard]] FlatContour InPlane(const std::vector<Eigen::Vector3d>& points);

/// Area, positive whichever way it turns.
[[nodiscard]] double AreaOf(const FlatContour& contour);

}  // namespace plumb
