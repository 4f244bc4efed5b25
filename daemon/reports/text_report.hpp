// SPDX-License-Identifier: Apache-2.0
// A comparison as a table of text.
#pragma once

#include <string>

#include "algo/base/message.hpp"
#include "algo/comparison/comparison.hpp"
#include "daemon/result/stored_result.hpp"

namespace plumb {

/// Verdict with its reasons, the six numbers by name with uncertainty, tolerance, judgement and
/// what to do, and the scan quality, in this language. Without an answer there are no numbers.
[[nodiscard]] std::string ComparisonText(const StoredResult& result, const Catalogue& language);

/// One line for a picture, in English: the verdict and the residual if nothing else is known.
[[nodiscard]] std::string PictureSubtitle(const Comparison& comparison);

/// What the reference was: a contour of a planning CT, or the skin of its images.
[[nodiscard]] Message ComparedWith(const StoredReference& planned);

/// What a person has stated of its surface; empty: nothing.
[[nodiscard]] Message SurfaceStated(const StoredReference& planned);

/// Which markers place the scan, and how well they fit where they were fitted.
[[nodiscard]] Message MarkersThatPlace(const StoredAlignment& alignment);

}  // namespace plumb
