// Computes the positions of a marker's corners from the depth image.
#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "algo/geometry/back_projection.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// Side of the paper's window s for an image of this width: 11 px at 640 columns, odd, at least 3.
/// @throws std::invalid_argument if window_px_at_640 or image_width is not positive.
[[nodiscard]] int DepthWindow(int window_px_at_640, int image_width);

/// Corners in the camera frame as published (paper, Eq. markercornerposition): the depth at the
/// corner's pixel, otherwise the mean of the back-projected valid pixels of the window around it.
/// Nothing where the window is empty or the corner is outside the image. The mean moves x and y
/// towards the side that has depth (5-7 mm at a gap): for preset `paper` only.
/// @param rays  Of the view's camera.
/// @throws std::invalid_argument if depth image and rays do not fit together.
[[nodiscard]] std::array<std::optional<Eigen::Vector3d>, 4> PaperCornerPositions(
    const MarkerObservation& marker, const DepthView& view, const RayTable& rays,
    int window_px_at_640 = 11);

/// The plane of a marker's own face and the corners in it.
struct MarkerFace {
  MarkerCorners corners;  ///< Camera frame, metres, detector order.
  Eigen::Vector3d
      plane;  ///< (a, b, c): 1/z = a x + b y + c on the ray (x, y, 1); so a X + b Y + c Z = 1.
  double rms_m = 0.0;         ///< Depth residual of the inliers.
  int num_pixels = 0;         ///< Valid depth pixels inside the marker's outline.
  double inlier_share = 0.0;  ///< Fraction of these pixels that fit the plane, in (0, 1].
};

/// Fits a plane robustly to the depth inside the marker's outline and intersects it with each
/// corner's undistorted sub-pixel ray. Paper: depth at single pixels or window means; here the
/// plane of the face, because depth is missing or wrong at print edges, and single pixels tilt the
/// marker by 0.7 deg.
/// @return nothing if the outline is degenerate or leaves the image, fewer than 40 % of its pixels
///         have depth (or fewer than 12), or fewer than 60 % of those agree on a plane in front of
///         the camera.
/// @throws std::invalid_argument if depth image and rays do not fit together.
[[nodiscard]] std::optional<MarkerFace> FitMarkerFace(const MarkerObservation& marker,
                                                      const DepthView& view, const RayTable& rays);

}  // namespace plumb
