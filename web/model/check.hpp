// SPDX-License-Identifier: Apache-2.0
// Daily checks of the room's markers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "algo/verdict/verdict.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// State of the daily check for one day and sensor, by the newest check that passed or failed.
enum class DailyCheck : std::uint8_t { kPassed, kOverdue, kFailed };
template <>
inline constexpr auto kNamesOf<DailyCheck> = NamesUpTo<DailyCheck::kFailed>({"passed", "overdue",
                                                                             "failed"});

/// One quantity of a daily check.
struct CheckItem {
  std::string name;             ///< markers_seen, misfit, moved, side, scale or depth_scale.
  std::optional<double> value;  ///< Not set if it could not be computed.
  double limit = 0.0;
  std::string unit;
  bool passed = false;
  Message note;
};

/// A scan of the room's markers compared with the baseline.
struct CheckRecord {
  std::string id;
  WallClock::time_point time;
  std::string user;  ///< User who requested it.
  std::string sensor_serial;
  MarkerCheckStatus status = MarkerCheckStatus::kFailed;
  std::vector<Message> reasons;
  std::vector<CheckItem> items;
  std::size_t num_markers = 0;         ///< Markers that were seen well.
  std::vector<Message> cautions = {};  ///< Markers that were not seen.
};

/// The check whose marker positions are the baseline.
struct CheckBaseline {
  std::string check_id;
  WallClock::time_point set_at;
  std::string set_by;
  std::size_t num_markers = 0;
};

struct CheckStatus {
  std::vector<CheckRecord> checks;  ///< Newest first.
  std::optional<CheckBaseline> baseline;
  DailyCheck today = DailyCheck::kOverdue;
  /// What would change if the newest check takes the place of the baseline; empty without one.
  std::vector<Message> changes = {};
};

}  // namespace plumb
