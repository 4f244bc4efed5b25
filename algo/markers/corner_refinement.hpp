// Sub-pixel corners of a decoded marker, by fitting what its known pattern looks like through blur.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// The cells of one marker as it is seen upright: code cells row-major from the top left, highest
/// bit first, 1 = white.
struct MarkerPattern {
  std::uint64_t code = 0;
  int bits_per_side = 6;  ///< 1 to 8; a border of one black cell surrounds them.

  [[nodiscard]] bool White(int row, int column) const {
    return ((code >> (bits_per_side * bits_per_side - 1 - (row * bits_per_side + column))) & 1U) !=
           0;
  }
};

/// Light, 0 to 1, of each value of an 8-bit image.
using ToneTable = std::array<float, 256>;
[[nodiscard]] const ToneTable& SrgbTone();
/// Light is the value's power `gamma`; 1 is a camera that does not encode at all. > 0.
[[nodiscard]] ToneTable PowerTone(double gamma);

/// Parameters of RefineCorners().
struct CornerRefinementOptions {
  /// Undo the sRGB tone curve before anything is measured. Light is blurred before it is encoded,
  /// so in encoded values the white paper eats into the black border and corners move inward by up
  /// to half a pixel.
  bool linear_light = true;
  /// If given, undone instead of the sRGB curve; must outlive the call.
  const ToneTable* tone = nullptr;
  /// By how much white reaches into black, pixels of this image: what is left of a wrong tone
  /// curve, or ink that ran (< 0). Edges are taken back by it.
  double edge_shift_px = 0.0;
  /// Find the edge shift with the rest: a marker's black and white cells have one size, so white
  /// ones that look wider than black ones reveal it.
  bool find_edge_shift = false;
  /// If given, the bow that the lens puts on the sides is taken into account; coefficients of the
  /// image that is searched.
  std::optional<Intrinsics> intrinsics = std::nullopt;
};

/// What RefineCorners() found.
struct CornerRefinement {
  ImageCorners corners;              ///< As seen (distorted), pixel centres at integers.
  std::array<double, 4> sigma_px{};  ///< Standard deviation of each corner, per coordinate.
  double blur_px = 0.0;  ///< Mean blur across the four sides, as the sigma of a Gaussian.
  double contrast =
      0.0;  ///< Mean step from black to white, 0 to 1 of full scale (linear light if so asked).
  double relative_residual =
      0.0;  ///< RMS of the fit's residual over the contrast; about 0.02 on clean images.
  double edge_shift_px = 0.0;  ///< As given or found.
  /// RMS of the fit's residual in the image's own grey levels, whatever curve was undone: fits
  /// under several curves can be held against each other.
  double residual_levels = 0.0;
};

/// Fits the four sides of a marker's black square and intersects them.
///
/// Around each side the image is modelled, pixel by pixel, as the marker's own cells (border and
/// two rows of code, paper outside) under a Gaussian blur across and along the side, with black and
/// white levels that may change along it. Line, blur and levels are found together by robust
/// Gauss-Newton; so neither the neighbouring white cells nor the blur pull the line, as they do
/// with gradient-based refinement. Symmetric blur (motion) widens the edge but does not move it.
///
/// @param gray     CV_8UC1.
/// @param initial  Corners in detector order, right to about a fifth of a cell or two pixels.
/// @return nothing where no plausible fit exists: too little contrast, too few pixels, or the lines
/// left their start.
/// @throws std::invalid_argument if the image is empty or of another type.
/// Thread-safe and deterministic.
[[nodiscard]] std::optional<CornerRefinement> RefineCorners(
    const cv::Mat& gray, const ImageCorners& initial, const MarkerPattern& pattern,
    const CornerRefinementOptions& options = {});

}  // namespace plumb
