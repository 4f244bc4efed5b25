#include "daemon/records/store_recovery.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "daemon/records/audit_store.hpp"
#include "daemon/records/backup.hpp"
#include "daemon/records/file_copy.hpp"
#include "daemon/records/scan_digests.hpp"
#include "daemon/records/scan_store.hpp"
#include "daemon/records/stored_values.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

/// In the state folder; states that missing scans are lost for good: so many, or any if it is
/// empty.
constexpr const char* kLostFile = "scans-are-lost";

/// A finished scan and the result of examining its files.
struct LookedAt {
  std::int64_t id = 0;
  std::string before, now;  ///< Why its files cannot be used; empty if they can.
  bool is_approved = false;
  fs::path aside = {};  ///< Where its files were set aside; empty if they are not to be moved back.
};

/// True if the folder is missing, too. What cannot be listed may hold anything.
bool HoldsNothing(const fs::path& folder) {
  std::error_code error;
  fs::directory_iterator entry(folder, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    if (entry->path().filename() != "lost+found") return false;
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
  void Discard(const fs::path& folder, const std::string& why);
  void SetAside(const fs::path& folder, const std::string& name, const std::string& why);

  Database& database_;
  const ScanFolders& folders_;
  const ExaminePath& look_;
  RecoveryReport& report_;
  std::string confirmed_;  ///< Which scans a person has confirmed as lost, for the audit log.
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
                     fmt::format("{} scans had not ended", report_.interrupted_scans));
  }
  if (!confirmed_.empty()) AppendAuditEntry(database_, kSelf, "scans.lost", "", confirmed_);
  for (const LookedAt& scan : scans) {
    if (!scan.aside.empty())
      AppendAuditEntry(
          database_, kSelf, "folder.return", ScanId(scan.id),
          fmt::format("from {}, with the files that were stored", scan.aside.string()));
  }
  NoteAvailability(scans);
  transaction.Commit();
  for (const fs::path& folder : folders_.All()) CollectOrphan(folder);
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
      scan.now.clear();
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
  std::string other;
  if (look_(file).error == 0) {
    constexpr std::size_t kLongest = 64;
    std::string said = ReadTextFile(file, kLongest);
    while (!said.empty() && said.back() == '\n') said.pop_back();
    if (said.empty() || said == std::to_string(missing)) {
      confirmed_ =
          fmt::format("{} of {} stored scans were confirmed as lost", missing, seen_before);
      return;
    }
    other = fmt::format(" (not for {:?}, as it was confirmed)", said);
  }
  throw ScansMissing(fmt::format(
      "{} of {} stored scans cannot be seen (of scan {}, {}): is the disk mounted at {}? Nothing "
      "was changed. Mount the disk or put a backup in its place, and start plumbd again; if these "
      "files are gone for good, confirm that{}: with lost_scans = {} in plumb-recovery.toml (field "
      "guide, Recover a unit), or with an empty file {}",
      missing, seen_before, ScanId(first->id), first->now, (folders_.scans()).string(), other,
      missing, file.string()));
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
  if (ScanFolders::IsStaging(folder)) return Discard(folder, "of a scan that had not ended");
  const std::string name = folder.filename().string();
  const std::int64_t id = ParseId(name).value_or(0);
  std::string outcome, failure;
  {
    Statement query =
        database_.Prepare("SELECT outcome, has_folder, failure FROM scans WHERE id = ?", id);
    if (query.Step()) {
      if (query.Integer(1) != 0) return;
      outcome = query.Text(0);
      failure = query.Text(2);
    }
  }
  if (outcome.empty()) {
    if (database_.Has("SELECT 1 FROM removed_scans WHERE id = ?", id))
      return Discard(folder, "of a scan that was removed");
    return SetAside(folder, name, "no scan of this number is known: is it of another database?");
  }
  if (failure == kInterrupted) {  // an older database may not know that the scan had ended
    return SetAside(folder, name + ScanFolders::kInterruptedSuffix,
                    "it is complete, but its scan was never recorded as finished");
  }
  if (outcome == "failed" || outcome == "cancelled")
    Discard(folder,
            fmt::format("of a scan that {}", outcome == "failed" ? "failed" : "was discarded"));
}

void Recovery::Discard(const fs::path& folder, const std::string& why) {
  std::error_code error;
  fs::remove_all(folder, error);
  if (error) return;  // the next start tries again
  ++report_.orphaned_folders;
  Transaction transaction(database_);
  AppendAuditEntry(database_, kSelf, "folder.remove", folder.filename().string(), why);
  transaction.Commit();
}

/// Its number may be assigned to another scan. If scans/ is a separate disk, it stays on that disk.
void Recovery::SetAside(const fs::path& folder, const std::string& name, const std::string& why) {
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
    throw DatabaseCorrupt(fmt::format(
        "restoring a backup into {} was interrupted: restore it again; what was stored before is "
        "in the newest of the folders before-restore-N in there",
        scans.state().string()));
  std::vector<fs::path> folders = scans.All();
  std::erase_if(folders, [](const fs::path& folder) {
    return ScanFolders::IsStaging(folder);
  });  // unfinished scans need not be kept
  if (folders.empty()) return;
  throw DatabaseCorrupt(
      fmt::format("the database {} is empty or missing, but there are scans of another one ({} and "
                  "{} more): put a backup of the database in "
                  "its place, or move the folder {} away too to start over",
                  (scans.state() / kDatabaseFile).string(), folders.front().string(),
                  folders.size() - 1, (scans.scans()).string()));
}

void ConfirmLostScans(const fs::path& state, int num_lost) {
  PlaceFile(state, kLostFile, std::to_string(num_lost));
}

void RecoverStore(Database& database, const ScanFolders& folders, const ExaminePath& look,
                  RecoveryReport& report) {
  Recovery(database, folders, look, report).Run();
}

}  // namespace plumb
