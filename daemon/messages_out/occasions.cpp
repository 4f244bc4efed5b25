// SPDX-License-Identifier: Apache-2.0
#include "daemon/messages_out/occasions.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "words/messages.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

constexpr std::chrono::hours kRepeatedAfter{24}, kShortestPause{1};
/// A backup counts as overdue after this many of its intervals: one may have to wait.
constexpr double kIntervalsUntilOverdue = 2.0;

/// Warnings that mean that something stored is not as it was written.
constexpr std::array kIntegrityWarnings = {
    say::upkeep::kReferencesUnusable, say::upkeep::kScansUnusable, say::upkeep::kScansSetAside,
    say::upkeep::kLogChanged,         say::upkeep::kLogUnchecked,  say::upkeep::kRolledBack,
    say::upkeep::kBackupNotAsMade};

bool Warns(const Status& status, MessageId of) {
  return std::ranges::any_of(status.storage.warnings,
                             [&](const Message& warning) { return warning.Is(of); });
}

void AddCheck(const Status& status, const OccasionRules& rules, const std::tm& local,
              std::vector<Occasion>& occasions) {
  const bool is_weekend = local.tm_wday == 0 || local.tm_wday == 6;
  const bool is_due = 60 * local.tm_hour + local.tm_min >= rules.check_due_min &&
                      (rules.check_on_weekends || !is_weekend);
  if (status.daily_check == DailyCheck::kFailed) {
    occasions.push_back({OccasionKind::kDailyCheck, {"failed"}, say::messages::CheckFailed()});
  } else if (status.daily_check == DailyCheck::kOverdue && is_due) {
    occasions.push_back({OccasionKind::kDailyCheck, {"overdue"}, say::messages::CheckOverdue()});
  }
}

void AddBackup(const Status& status, const OccasionRules& rules, double up_s,
               WallClock::time_point now, std::vector<Occasion>& occasions) {
  if (Warns(status, say::upkeep::kBackupFailed)) {
    occasions.push_back({OccasionKind::kBackup, {"failed"}, say::messages::BackupFailed()});
    return;
  }
  const double limit_s = 3600 * kIntervalsUntilOverdue * rules.backup_hours;
  const auto& made_at = status.storage.backup_made_at;
  const double age_s = made_at ? std::chrono::duration<double>(now - *made_at).count() : up_s;
  if (rules.makes_backups && age_s > limit_s) {
    occasions.push_back({OccasionKind::kBackup, {"overdue"}, say::messages::BackupOverdue()});
  } else if (Warns(status, say::upkeep::kBackupNotRehearsed)) {
    occasions.push_back(
        {OccasionKind::kBackup, {"not rehearsed"}, say::messages::BackupNotRehearsed()});
  }
}

}  // namespace

std::vector<Occasion> OccasionsOf(const Status& status, const OccasionRules& rules, double up_s,
                                  WallClock::time_point now, const std::tm& local) {
  std::vector<Occasion> occasions;
  AddCheck(status, rules, local, occasions);
  for (const Message& warning : status.storage.warnings) {
    if (!warning.Is(say::upkeep::kNearlyFull)) continue;
    occasions.push_back({OccasionKind::kDisk, {"nearly_full"}, say::messages::DiskNearlyFull()});
  }
  AddBackup(status, rules, up_s, now, occasions);
  if (!status.waiting.empty()) {
    Occasion waiting{
        OccasionKind::kApproval,
        {},
        say::messages::ApprovalWaiting(static_cast<std::int64_t>(status.waiting.size()))};
    for (const WaitingReference& one : status.waiting)
      waiting.parts.insert(one.reference_id + (one.planned_by.empty() ? " plan" : " approval"));
    occasions.push_back(std::move(waiting));
  }
  Occasion damaged{OccasionKind::kIntegrity, {}, say::messages::IntegrityFailed()};
  for (const MessageId id : kIntegrityWarnings)
    if (Warns(status, id)) damaged.parts.insert(std::string(id.name));
  if (!damaged.parts.empty()) occasions.push_back(std::move(damaged));
  if (status.state == ApplianceState::kFault && status.fault_kind == FaultKind::kStorage)
    occasions.push_back({OccasionKind::kStorage, {"fault"}, say::messages::StorageFailed()});
  return occasions;
}

std::vector<OccasionMemory::Told> OccasionMemory::ToTell(const std::vector<Occasion>& present,
                                                         Time now) {
  std::vector<Told> told;
  std::set<OccasionKind> lasting;
  for (const Occasion& occasion : present) {
    lasting.insert(occasion.kind);
    const auto found = past_.find(occasion.kind);
    const bool is_first = found == past_.end();
    const bool is_new = is_first || !std::ranges::includes(found->second.parts, occasion.parts);
    const auto pause = is_new ? kShortestPause : kRepeatedAfter;
    if (!is_first && now - found->second.told_at < pause) continue;
    told.push_back({.occasion = occasion, .is_repeated = !is_new});
    past_[occasion.kind] = {.parts = occasion.parts, .told_at = now};
  }
  for (auto& [kind, past] : past_)
    if (!lasting.contains(kind)) past.parts.clear();
  return told;
}

void OccasionMemory::NotTold(OccasionKind kind) {
  const auto found = past_.find(kind);
  if (found != past_.end()) found->second.parts.clear();
}

}  // namespace plumb
