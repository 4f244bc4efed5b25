// A comparison as a table for people.
#pragma once

#include <filesystem>
#include <string>

#include "algo/comparison/comparison.hpp"

namespace plumb {

/// Verdict with its reasons, the six numbers by name with words, uncertainty and tolerance, and why
/// to trust them.
[[nodiscard]] std::string ComparisonText(const Comparison& comparison,
                                         const CompareOptions& options);

/// One line for a picture: when nothing else is known, the verdict and the residual.
[[nodiscard]] std::string PictureSubtitle(const Comparison& comparison);

}  // namespace plumb
