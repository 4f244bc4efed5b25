// SPDX-License-Identifier: Apache-2.0
// Texts in pictures, replaceable so that a report in another language can translate them, and the
// marks at the edges of maps.
#pragma once

#include <string>
#include <string_view>

#include <Eigen/Core>

#include "algo/base/notice.hpp"

namespace plumb {

/// English by default. Texts with {} are fmt patterns. The texts must outlive the drawing.
struct PictureWords {
  std::string_view notice = kResearchNotice;
  std::string_view x_axis = "x (m), reference marker's frame", y_axis = "y (m)";
  std::string_view error_title = "Height difference: current \u2212 reference";
  std::string_view overlay_title = "Overlay: reference blue, current red";
  std::string_view height_title = "Heights of the reference";
  std::string_view error = "height difference", absolute_error = "|height difference|";
  std::string_view millimetres = "in millimetres", centimetres = "in centimetres";
  std::string_view higher = "current is higher", lower = "current is lower";
  std::string_view tolerance = "tolerance";
  std::string_view not_in_both = "not measured in both scans",
                   not_in_either = "not measured in either scan", not_measured = "not measured";
  std::string_view hole = "hole in the region";
  std::string_view outlined = "outlined: the region; paler outside";
  std::string_view surface_on_top = "surface on top", reference = "reference", current = "current";
  std::string_view both_within = "both, within {} mm";
  std::string_view height = "height", isocentre = "isocentre";
  char decimal = '.';
};

/// A word at the edge of a map: "HEAD".
struct MapMark {
  std::string name;
  Eigen::Vector2d toward = Eigen::Vector2d::UnitY();  ///< Unit vector of the map, x right, y up.
};

}  // namespace plumb
