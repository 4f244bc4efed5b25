// SPDX-License-Identifier: Apache-2.0
// Estimates the camera's tone curve from the blurred edges of a sweep's markers.
#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/markers/corner_refinement.hpp"

namespace plumb {

/// A marker in one image of the sweep.
struct MarkerSighting {
  cv::Mat gray;          ///< CV_8UC1; shared by all sightings in the image.
  ImageCorners corners;  ///< As detected.
  MarkerPattern pattern;
};

struct SweepTone {
  double gamma = 0;        ///< Light is the value to the power gamma.
  double sigma_gamma = 0;  ///< Standard deviation, from the disagreement of groups of sightings.
  ToneTable table{};
  /// Edge shift that remains under this curve: white extends into black by this many pixels (median
  /// over sightings).
  double edge_shift_px = 0;
  double sigma_edge_shift_px = 0;
};

/// Blur is symmetric in light. Under the correct curve an edge from black to white is symmetric
/// too; under a wrong one it is not, and the asymmetry moves the edge, so that every marker looks
/// too small or too large. The estimate is the power that gives the best fits of the markers' sides
/// over all sightings. A camera's true curve is not a power, but between a marker's black and white
/// one power has the same asymmetry.
/// @return nothing if there are too few usable sightings; the caller then assumes the sRGB curve.
/// @throws Interrupted on a stop request.
/// Deterministic; runs in parallel on TBB's threads.
[[nodiscard]] std::optional<SweepTone> EstimateTone(const std::vector<MarkerSighting>& sightings,
                                                    const std::stop_token& stop = {});

}  // namespace plumb
