// Where the current scene lies in the reference scene, from the markers that both saw.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/comparison/comparison.hpp"

namespace plumb {

/// Alignment of two marker maps, or why there is none.
struct AlignmentOutcome {
  std::optional<Alignment> alignment;
  std::string failure;                ///< A sentence where there is no alignment.
  std::vector<std::string> warnings;  ///< E.g. markers that moved.
};

/// Rigid transform between the corners of the markers (ids) in both maps (paper, eq. of the scene alignment; Horn).
///
/// Preset `paper`: every corner, equal weights; fails only where no pose is determined (no shared marker, NaN).
/// Preset `best`: weights from the markers' sigmas; finds the largest set of markers that agree, then accuses each of the
/// others: a marker moved if its residual against the rest exceeds both `options.moved_marker_m` and
/// `options.moved_marker_sigmas` of its own standard deviation (its corners' and the fit's). Fails with fewer than
/// `options.min_shared_markers` good ones, and where two groups of equal size disagree.
[[nodiscard]] AlignmentOutcome AlignScenes(const MarkerMap& reference, const MarkerMap& current, const CompareOptions& options);

}  // namespace plumb
