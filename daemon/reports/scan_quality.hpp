// SPDX-License-Identifier: Apache-2.0
// A scan's quality: one list for the page, the page without script and the report.
#pragma once

#include <optional>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/files/stored_scene.hpp"
#include "daemon/result/stored_result.hpp"
#include "web/model/scan.hpp"
#include "web/service/scan_service.hpp"

namespace plumb {

/// Those of a scan's files that its quality is judged by.
struct ScanFiles {
  std::optional<StoredScene> scene;
  std::optional<StoredResult> result;
  std::vector<Message> unreadable;  ///< Why a file that exists is not used.
};

[[nodiscard]] ScanFiles FilesOf(const Scan& scan);

/// Largest share of lost frames with which a result can be accepted.
inline constexpr double kMostLostFrames = 0.5;

/// @param warm_up_min  Time that a sensor must have been on to be warm.
[[nodiscard]] web::ScanQuality QualityOf(const Scan& scan, const ScanFiles& files,
                                         double warm_up_min);

}  // namespace plumb
