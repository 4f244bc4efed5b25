// The camera's tone curve, read from the blurred edges of a sweep's markers.
#pragma once

#include <optional>
#include <stop_token>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/markers/corner_refinement.hpp"

namespace plumb {

/// A marker in one image of the sweep.
struct MarkerSighting {
  cv::Mat gray;          ///< CV_8UC1; shared by the image's sightings.
  ImageCorners corners;  ///< As detected.
  MarkerPattern pattern;
};

struct SweepTone {
  double gamma = 0;        ///< Light is the value's power gamma.
  double sigma_gamma = 0;  ///< Standard deviation, from how groups of sightings disagree.
  ToneTable table{};
  /// What this curve leaves: white reaches into black by so many pixels (median over sightings).
  double edge_shift_px = 0;
  double sigma_edge_shift_px = 0;
  int num_sightings = 0;
};

/// Blur is symmetric in light. Under the right curve an edge from black to white is too; under a
/// wrong one it is not, and the same asymmetry moves the edge, so that every marker looks too small
/// or too large. The power of the value that lets the markers' sides be fitted best, over all
/// sightings, is taken. A camera's true curve is no power, but between a marker's black and white
/// one power has the same asymmetry.
/// @return nothing if there are too few usable sightings; the caller then assumes the sRGB curve.
/// Deterministic, spread over TBB's threads. @throws Interrupted on a stop request.
[[nodiscard]] std::optional<SweepTone> EstimateTone(const std::vector<MarkerSighting>& sightings,
                                                    const std::stop_token& stop = {});

}  // namespace plumb
