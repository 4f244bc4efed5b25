// SPDX-License-Identifier: Apache-2.0
// The six numbers of a stored result as every presentation shows them.
#pragma once

#include <vector>

#include "algo/verdict/shown_row.hpp"
#include "daemon/result/stored_result.hpp"

namespace plumb {

/// None without an answer, which must not be acted on.
[[nodiscard]] std::vector<ShownRow> ShownRowsOf(const StoredResult& result);

/// Of a correction alone, as the control socket sends it: its tolerances and the axes of an unknown
/// room are not sent.
[[nodiscard]] std::vector<ShownRow> ShownRowsOf(const StoredCorrection& correction,
                                                Verdict verdict);

}  // namespace plumb
