// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/store_recovery.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "daemon/database/audit_store.hpp"
#include "daemon/database/scan_digests.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/records/scan_store.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "daemon/state_folder/restore_note.hpp"
#include "daemon/state_folder/scan_bin.hpp"
#include "daemon/state_folder/scan_numbers.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

/// In the state folder; states that missing scans are lost for good: so many, or any if it is
/// empty.
constexpr const char* kLostFile = "scans-are-lost";

/// A finished scan and the result of examining its files.
struct LookedAt {
  std::int64_t id = 0;
  std::string before;  ///< Why its files could not be used, in English; empty if they could.
  Message now;         ///< Why they cannot be used now; empty if they can.
  bool is_approved = false;
  fs::path aside = {};  ///< Where its files were set aside; empty if they are not to be moved back.
};

/// True if the folder is missing, too. What cannot be listed may hold anything.
bool HoldsNothing(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    const fs::path name = entry->path().filename();
    if (name != "lost+found" && name != ScanFolders::kBin) return false;
  }
  return !error || error == std::errc::no_such_file_or_directory;
}

/// One start of a store. Borrows its arguments.
class Recovery {
 public:
  Recovery(Database& database, const ScanFolders& folders, const ExaminePath& look,
           RecoveryReport& report)
      : database_(database), folders_(folders), look_(look), report_(report) {}

  void Run();

 private:
  [[nodiscard]] std::vector<LookedAt> ExamineScans();
  [[nodiscard]] fs::path FindAside(std::int64_t scan, const std::vector<FileDigest>& files);
  void RefuseIfMostAreMissing(const std::vector<LookedAt>& scans);
  void MoveBack(std::vector<LookedAt>& scans);
  void NoteAvailability(const std::vector<LookedAt>& scans);
  void CollectOrphan(const fs::path& folder);
  void Discard(const fs::path& folder, const Message& why);
  void SetAside(const fs::path& folder, const std::string& name, const Message& why);

  Database& database_;
  const ScanFolders& folders_;
  const ExaminePath& look_;
  RecoveryReport& report_;
  Message confirmed_;  ///< Which scans a person has confirmed as lost, for the audit log.
};

void Recovery::Run() {
  std::vector<LookedAt> scans = ExamineScans();
  RefuseIfMostAreMissing(scans);
  MoveBack(scans);
  Transaction transaction(database_);
  FailInterruptedScans(database_);
  report_.interrupted_scans = database_.num_changed();
  if (report_.interrupted_scans > 0) {
    AppendAuditEntry(database_, kSelf, "scan.interrupted", "",
                     say::store::LogInterrupted(report_.interrupted_scans));
  }
  if (!confirmed_.empty()) AppendAuditEntry(database_, kSelf, "scans.lost", "", confirmed_);
  for (const LookedAt& scan : scans) {
    if (!scan.aside.empty())
      AppendAuditEntry(database_, kSelf, "folder.return", ScanId(scan.id),
                       say::store::LogReturned(scan.aside.string()));
  }
  NoteAvailability(scans);
  transaction.Commit();
  for (const fs::path& folder : folders_.All()) CollectOrphan(folder);
  NoteStrayInBin(database_, folders_);
  std::error_code ignored;
  fs::remove(folders_.state() / kLostFile, ignored);  // valid for this start only
}

/// Examines each file once: whether it exists and has its size. Its content is checked later.
std::vector<LookedAt> Recovery::ExamineScans() {
  std::vector<LookedAt> scans;
  std::vector<bool> has_scene;
  {
    Statement query = database_.Prepare(
        "SELECT id, unavailable, outcome, EXISTS (SELECT 1 FROM refs WHERE scan_id = scans.id AND "
        "approved_by <> '') FROM scans WHERE has_folder = 1 ORDER BY id");
    while (query.Step()) {
      scans.push_back({.id = query.Integer(0),
                       .before = query.Text(1),
                       .now = {},
                       .is_approved = query.Integer(3) != 0});
      has_scene.push_back(query.Text(2) == "done");
    }
  }
  for (std::size_t i = 0; i < scans.size(); ++i) {
    std::vector<FileDigest> files = StoredDigests(database_, scans[i].id);
    if (files.empty() && has_scene[i])  // stored by an older Plumb, and not examined since
      files.push_back({.path = kSceneMarker});
    scans[i].now = WhyNotThere(folders_.Scan(ScanId(scans[i].id)), files, look_);
    if (!scans[i].now.empty()) scans[i].aside = FindAside(scans[i].id, files);
  }
  return scans;
}

/// A start with an older database sets the folders of newer scans aside. By their digests they are
/// recognised when the newer database is back.
fs::path Recovery::FindAside(std::int64_t scan, const std::vector<FileDigest>& files) {
  std::error_code ignored;
  if (files.empty() || fs::exists(fs::symlink_status(folders_.Scan(ScanId(scan)), ignored)))
    return {};
  for (const fs::path& folder : folders_.SetAsideAs(ScanId(scan))) {
    if (WhyNotThere(folder, files, look_).empty() && WhyNotIntact(folder, files).empty())
      return folder;
  }
  return {};
}

/// A folder that cannot be moved stays where it is, and its scan counts as unavailable.
void Recovery::MoveBack(std::vector<LookedAt>& scans) {
  for (LookedAt& scan : scans) {
    if (scan.aside.empty()) continue;
    std::error_code error;
    fs::create_directories(folders_.scans(), error);
    fs::rename(scan.aside, folders_.Scan(ScanId(scan.id)), error);
    if (error) {
      scan.aside.clear();
    } else {
      scan.now = {};
    }
  }
}

/// A single missing scan is an accident, unless nothing else is there either; half of all scans
/// missing at once is a disk that is not mounted.
void Recovery::RefuseIfMostAreMissing(const std::vector<LookedAt>& scans) {
  std::size_t seen_before = 0, missing = 0;
  const LookedAt* first = nullptr;
  for (const LookedAt& scan : scans) {
    if (!scan.before.empty()) continue;
    ++seen_before;
    if (scan.now.empty() || !scan.aside.empty()) continue;
    ++missing;
    if (first == nullptr) first = &scan;
  }
  const bool is_empty_disk = missing == seen_before && HoldsNothing(folders_.scans());
  if (missing == 0 || ((missing < 2 || 2 * missing < seen_before) && !is_empty_disk)) return;
  const fs::path file = folders_.state() / kLostFile;
  std::string confirmed;
  if (look_(file).error == 0) {
    constexpr std::size_t kLongest = 64;
    std::string said = ReadTextFile(file, kLongest);
    while (!said.empty() && said.back() == '\n') said.pop_back();
    if (said.empty() || said == std::to_string(missing)) {
      confirmed_ = say::store::LogLost(missing, seen_before);
      return;
    }
    confirmed = fmt::format("{:?}", said);
  }
  const std::string scan = ScanId(first->id), disk = folders_.scans().string();
  throw ScansMissing(
      confirmed.empty()
          ? say::store::ScansMissing(missing, seen_before, scan, first->now, disk, file.string())
          : say::store::ScansMissingNotAsConfirmed(missing, seen_before, scan, first->now, disk,
                                                   confirmed, file.string()));
}

void Recovery::NoteAvailability(const std::vector<LookedAt>& scans) {
  for (const LookedAt& scan : scans) {
    SetUnavailable(database_, scan.id, scan.before, scan.now);
    report_.lost_scans += scan.before.empty() && !scan.now.empty() ? 1 : 0;
    const bool was_away = !scan.before.empty() || !scan.aside.empty();
    report_.attached_scans += was_away && scan.now.empty() ? 1 : 0;
    report_.broken_references += scan.is_approved && !scan.now.empty() ? 1 : 0;
  }
}

/// Removes the remains of a crash or a removal; keeps folders that no row explains.
void Recovery::CollectOrphan(const fs::path& folder) {
  if (ScanFolders::IsStaging(folder)) return Discard(folder, say::store::LogOfUnfinished());
  const std::string name = folder.filename().string();
  const std::int64_t id = ParseId(name).value_or(0);
  std::string outcome;
  Message failure;
  {
    Statement query = database_.Prepare(
        "SELECT outcome, has_folder, failure, failure_message FROM scans WHERE id = ?", id);
    if (query.Step()) {
      if (query.Integer(1) != 0) return;
      outcome = query.Text(0);
      failure = MessageIn(query.Text(3), query.Text(2));
    }
  }
  if (outcome.empty()) {
    if (database_.Has("SELECT 1 FROM bin WHERE scan_id = ?", id)) return MoveToBin(folders_, name);
    if (database_.Has("SELECT 1 FROM removed_scans WHERE id = ?", id))
      return Discard(folder, say::store::LogOfRemoved());
    return SetAside(folder, name, say::store::LogOfUnknown());
  }
  // 0.2.0 stored the sentence only.
  if (failure.Is(say::store::kInterrupted) ||
      failure.English() ==
          say::store::Interrupted()
              .English()) {  // an older database may not know that the scan had ended
    return SetAside(folder, name + ScanFolders::kInterruptedSuffix, say::store::LogOfUnrecorded());
  }
  if (outcome == "failed" || outcome == "cancelled")
    Discard(folder, outcome == "failed" ? say::store::LogOfFailed() : say::store::LogOfDiscarded());
}

void Recovery::Discard(const fs::path& folder, const Message& why) {
  std::error_code error;
  fs::remove_all(folder, error);
  if (error) return;  // the next start tries again
  ++report_.orphaned_folders;
  Transaction transaction(database_);
  AppendAuditEntry(database_, kSelf, "folder.remove", folder.filename().string(), why);
  transaction.Commit();
}

/// Its number may be assigned to another scan. If scans/ is a separate disk, it stays on that disk.
void Recovery::SetAside(const fs::path& folder, const std::string& name, const Message& why) {
  std::error_code error;
  fs::path target;
  for (const fs::path& aside : folders_.SetAside()) {
    fs::create_directories(aside, error);
    target = aside / name;
    for (int i = 2; fs::exists(target, error); ++i) target = aside / fmt::format("{}-{}", name, i);
    fs::rename(folder, target, error);
    if (error != std::errc::cross_device_link) break;
  }
  if (error) throw DiskRefused(DescribeWriteError(target, error.value()));
  ++report_.foreign_folders;
  Transaction transaction(database_);
  AppendAuditEntry(database_, kSelf, "folder.set_aside", target.filename().string(), why);
  transaction.Commit();
}

}  // namespace

void RefuseScansOfAnother(Database& database, const ScanFolders& scans) {
  if (database.FirstInteger("PRAGMA user_version").value_or(0) != 0) return;
  if (IsRestoreInterrupted(scans.state()))
    throw DatabaseCorrupt(say::store::RestoreInterrupted(scans.state().string()));
  std::vector<fs::path> folders = scans.All();
  std::erase_if(folders, [](const fs::path& folder) {
    return ScanFolders::IsStaging(folder);
  });  // unfinished scans need not be kept
  if (folders.empty()) {
    if (LastScanNumber(scans) == 0) return;
    throw DatabaseCorrupt(say::store::DatabaseGone((scans.state() / kDatabaseFile).string()));
  }
  throw DatabaseCorrupt(say::store::ScansOfAnother((scans.state() / kDatabaseFile).string(),
                                                   folders.front().string(), folders.size() - 1,
                                                   scans.scans().string()));
}

void ConfirmLostScans(const fs::path& state, int num_lost) {
  PlaceFile(state, kLostFile, std::to_string(num_lost));
}

void RecoverStore(Database& database, const ScanFolders& folders, const ExaminePath& look,
                  RecoveryReport& report) {
  Recovery(database, folders, look, report).Run();
}

}  // namespace plumb
