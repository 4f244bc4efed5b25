// SPDX-License-Identifier: Apache-2.0
// What a unit tells people who are not looking at it, and when it tells them again.
#pragma once

#include <chrono>
#include <ctime>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "web/model/status.hpp"

namespace plumb {

enum class OccasionKind {
  kDailyCheck,
  kDisk,
  kBackup,
  kApproval,
  kIntegrity,
  kStorage,
  kTest,  ///< Somebody asked for a test message.
};
template <>
inline constexpr auto kNamesOf<OccasionKind> = NamesUpTo<OccasionKind::kTest>(
    {"daily_check", "disk", "backup", "approval", "integrity", "storage", "test"});

struct Occasion {
  OccasionKind kind = OccasionKind::kTest;
  /// What it consists of: one more is a new event. They are not sent.
  std::set<std::string> parts;
  Message text;  ///< Names no patient, no person, no scan and no file.
};

struct OccasionRules {
  int check_due_min = 9 * 60;  ///< Minutes after midnight.
  bool check_on_weekends = false;
  double backup_hours = 24.0;  ///< Between two backups.
  bool makes_backups = false;
};

/// @param up_s  Time since the start: a unit that was just started has had no time for a backup.
/// @param now  The same as `local`, which is the time on the clock on the wall.
[[nodiscard]] std::vector<Occasion> OccasionsOf(const Status& status, const OccasionRules& rules,
                                                double up_s, WallClock::time_point now,
                                                const std::tm& local);

/// Says which occasions are told now: each event once, and as long as it lasts once a day. New
/// events of a kind wait for an hour after the last one of that kind, so that what comes and goes
/// fills nobody's mailbox.
class OccasionMemory {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct Told {
    Occasion occasion;
    bool is_repeated = false;  ///< The same as was told before.
  };

  /// @param present  All that there is now.
  [[nodiscard]] std::vector<Told> ToTell(const std::vector<Occasion>& present, Time now);

 private:
  struct Past {
    std::set<std::string> parts;  ///< Empty: it has ended.
    Time told_at;
  };
  std::map<OccasionKind, Past> past_;
};

}  // namespace plumb
