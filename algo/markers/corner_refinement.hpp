// SPDX-License-Identifier: Apache-2.0
// Sub-pixel corners of a decoded marker, by fitting a model of its known pattern under blur.
#pragma once

#include <array>
#include <optional>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/markers/marker_pattern.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

[[nodiscard]] const ToneTable& SrgbTone();
/// Light is the value to the power `gamma`; 1 is a camera without encoding. > 0.
[[nodiscard]] ToneTable PowerTone(double gamma);

/// Parameters of RefineCorners().
struct CornerRefinementOptions {
  /// Invert the sRGB tone curve before measuring. Light is blurred before it is encoded, so in
  /// encoded values the white paper extends into the black border and corners move inward by up to
  /// half a pixel.
  bool linear_light = true;
  /// If set, used instead of the sRGB curve; must outlive the call.
  const ToneTable* tone = nullptr;
  /// Distance by which white extends into black in pixels of this image: the remainder of a wrong
  /// tone curve, or bleeding ink (< 0). Edges are corrected by it.
  double edge_shift_px = 0.0;
  /// Also estimate the edge shift. A marker's black and white cells have the same size, so white
  /// cells that look wider than black ones reveal it.
  bool find_edge_shift = false;
  /// If set, corrects for the curvature of the sides by the lens; coefficients of the searched
  /// image.
  std::optional<Intrinsics> intrinsics = std::nullopt;
};

/// Result of RefineCorners().
struct CornerRefinement {
  ImageCorners corners;              ///< As seen (distorted), with pixel centres at integers.
  std::array<double, 4> sigma_px{};  ///< Standard deviation of each corner per coordinate.
  double blur_px = 0.0;  ///< Mean blur across the four sides, as the sigma of a Gaussian.
  double contrast =
      0.0;  ///< Mean step from black to white, 0 to 1 of full scale (in linear light if requested).
  double edge_shift_px = 0.0;  ///< As given or estimated.
  /// RMS residual of the fit in the image's own grey levels, for any curve that was inverted, so
  /// that fits with several curves can be compared.
  double residual_levels = 0.0;
};

/// Fits the four sides of a marker's black square and intersects them.
///
/// Around each side the image is modelled pixel by pixel as the marker's own cells (border and two
/// rows of code, paper outside) under a Gaussian blur across and along the side, with black and
/// white levels that may vary along it. Line, blur and levels are estimated together by robust
/// Gauss-Newton, so that neither the neighbouring white cells nor the blur displace the line, as
/// they do with gradient-based refinement. Symmetric blur (motion) widens the edge but does not
/// move it.
///
/// @param gray     CV_8UC1.
/// @param initial  Corners in detector order, accurate to about a fifth of a cell or two pixels.
/// @return nothing if no plausible fit exists: too little contrast, too few pixels, or lines that
///         moved too far from their start.
/// @throws std::invalid_argument if the image is empty or of another type.
/// Thread-safe and deterministic.
[[nodiscard]] std::optional<CornerRefinement> RefineCorners(
    const cv::Mat& gray, const ImageCorners& initial, const MarkerPattern& pattern,
    const CornerRefinementOptions& options = {});

}  // namespace plumb
