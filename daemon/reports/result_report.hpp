// SPDX-License-Identifier: Apache-2.0
// The report of a result that is in no store.
#pragma once

#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "daemon/reports/pdf_report.hpp"
#include "daemon/result/stored_result.hpp"

namespace plumb {

/// What `plumb compare` wrote as the page of a scan: verdict, six numbers, quality, pictures. Of
/// patient, plan and acceptance only what is given.
/// @param patient  Code or name, as the caller may show it.
/// @param when  Of the report.
[[nodiscard]] ScanReport DescribeResult(const StoredResult& result, const std::string& patient,
                                        const std::string& when, std::vector<cv::Mat> pictures,
                                        const Catalogue& language);

}  // namespace plumb
