// SPDX-License-Identifier: Apache-2.0
// The events that a unit sends messages about, and when it repeats them.
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

/// Decides which messages are due: one when an event begins, and one a day for as long as it lasts.
/// A new event of the same kind waits until an hour after the last message of that kind, so that a
/// condition that comes and goes does not flood the mailbox. An event whose last message was given
/// up by every way counts as new.
class OccasionMemory {
 public:
  using Time = std::chrono::steady_clock::time_point;
  struct Told {
    Occasion occasion;
    bool is_repeated = false;  ///< The same as was told before.
  };

  /// @param present  All that there is now.
  [[nodiscard]] std::vector<Told> ToTell(const std::vector<Occasion>& present, Time now);
  /// Every way gave up the last message of that kind.
  void NotTold(OccasionKind kind);

 private:
  struct Past {
    std::set<std::string> parts;  ///< Empty: it has ended.
    Time told_at;
  };
  std::map<OccasionKind, Past> past_;
};

}  // namespace plumb
