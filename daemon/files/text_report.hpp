// A comparison as a table of text.
#pragma once

#include <string>

#include "algo/comparison/comparison.hpp"

namespace plumb {

/// Verdict with its reasons, the six numbers by name with direction, uncertainty and tolerance, and
/// the scan quality.
[[nodiscard]] std::string ComparisonText(const Comparison& comparison,
                                         const CompareOptions& options);

/// One line for a picture: the verdict and the residual if nothing else is known.
[[nodiscard]] std::string PictureSubtitle(const Comparison& comparison);

}  // namespace plumb
