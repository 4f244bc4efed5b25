// Opening the store, and what a crash left behind.
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "daemon/records/schema.hpp"
#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

namespace fs = std::filesystem;
using store::ScanId;

namespace {

/// In the state folder; says that missing scans are gone for good.
constexpr const char* kLostFile = "scans-are-lost";

bool IsStaging(const fs::path& folder) {
  return folder.filename().string().starts_with(".staging-");
}

}  // namespace

Store::Store(const fs::path& folder, StoreOptions options)
    : folder_(fs::absolute(folder)), options_(std::move(options)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) throw DiskRefused(DescribeWriteError(folder_, error.value()));
  CheckWritable();
  folder_lock_.Take(folder_);
  OpenDatabase();
  RefuseScansOfAnother();
  Migrate(*write_);
  read_ = std::make_unique<Database>(folder_ / "plumb.db", Database::Access::kReadOnly);
  list_ = std::make_unique<Database>(folder_ / "plumb.db", Database::Access::kReadOnly);
  Recover();
  fs::create_directories(folder_ / "scans", error);
  if (error) throw DiskRefused(DescribeWriteError(folder_ / "scans", error.value()));
}

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

void FolderLock::Take(const fs::path& folder) {
  fd_ = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd_ >= 0 && ::flock(fd_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
    throw DatabaseBusy(
        fmt::format("another plumbd uses the folder {}: stop one of them, or give "
                    "each a state folder of its own",
                    folder.string()));
}

/// A program that copies the database holds it for a while: another plumbd does not let go.
void Store::OpenDatabase() {
  constexpr std::chrono::milliseconds kPause(500);
  for (std::chrono::milliseconds waited{0};; waited += kPause) {
    try {
      write_ = std::make_unique<Database>(folder_ / "plumb.db", Database::Access::kReadWrite,
                                          options_.busy_wait);
      recovery_.checked_database = write_->CheckIntegrity(options_.check_limit);
      return;
    } catch (const DatabaseBusy&) {
      write_.reset();
      if (waited >= options_.lock_wait) throw;
    }
    if (options_.sleep) {
      options_.sleep(kPause);
    } else {
      std::this_thread::sleep_for(kPause);
    }
  }
}

std::unique_ptr<Store> Store::OpenReadable(const fs::path& folder) {
  std::unique_ptr<Store> store(new Store);
  store->folder_ = fs::absolute(folder);
  for (std::unique_ptr<Database>* database : {&store->write_, &store->read_, &store->list_}) {
    *database = std::make_unique<Database>(store->folder_ / "plumb.db", Database::Access::kFrozen);
  }
  (void)store->Patients();  // the tables are there
  return store;
}

void Store::CheckWritable() const {
  const fs::path probe = folder_ / ".writable";
  const int fd = ::open(probe.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  const int reason = fd < 0 ? errno : 0;
  if (fd >= 0) {
    ::close(fd);
    ::unlink(probe.c_str());
  }
  if (reason == 0 || reason == ENOSPC || reason == EDQUOT || reason == EMFILE || reason == ENFILE)
    return;
  throw DiskRefused(
      fmt::format("cannot write to {}: {}; check the disk, make it writable and start plumbd again",
                  folder_.string(), std::strerror(reason)));
}

void Store::Recover() {
  const std::lock_guard lock(write_mutex_);
  const std::vector<LookedAt> scans = LookAtScans();
  RefuseIfMostAreMissing(scans);
  Transaction transaction(*write_);
  FailInterrupted();
  recovery_.interrupted_scans = write_->num_changed();
  if (recovery_.interrupted_scans > 0) {
    Write(store::kSelf, "scan.interrupted", "",
          fmt::format("{} scans had not ended", recovery_.interrupted_scans));
  }
  NoteAvailability(scans);
  transaction.Commit();
  CollectOrphans();
  std::error_code ignored;
  fs::remove(folder_ / kLostFile, ignored);  // it was for this start
}

/// One look at each: whether a file is there and has its size. Its content is checked later.
std::vector<Store::LookedAt> Store::LookAtScans() {
  std::vector<LookedAt> scans;
  std::vector<bool> has_scene;
  {
    Statement query = write_->Prepare(
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
    std::vector<FileDigest> files = StoredDigests(scans[i].id);
    if (files.empty() && has_scene[i])  // of an older Plumb, and not looked at since
      files.push_back({.path = kSceneMarker, .sha256 = {}});
    scans[i].now = WhyNotThere(ScanFolder(ScanId(scans[i].id)), files, options_.look);
  }
  return scans;
}

/// One scan that is gone is an accident; half of all at once is a disk that is not mounted.
void Store::RefuseIfMostAreMissing(const std::vector<LookedAt>& scans) {
  std::size_t seen_before = 0, missing = 0;
  const LookedAt* first = nullptr;
  for (const LookedAt& scan : scans) {
    if (!scan.before.empty()) continue;
    ++seen_before;
    if (scan.now.empty()) continue;
    ++missing;
    if (first == nullptr) first = &scan;
  }
  if (missing < 2 || 2 * missing < seen_before) return;
  if (options_.look(folder_ / kLostFile).error == 0) return;
  throw ScansMissing(fmt::format(
      "{} of {} stored scans cannot be seen (of scan {}, {}): is the disk mounted at {}? Nothing "
      "was changed. Mount the disk or put a backup in its place, and start plumbd again; if these "
      "files are gone for good, make an empty file {} first",
      missing, seen_before, ScanId(first->id), first->now, (folder_ / "scans").string(),
      (folder_ / kLostFile).string()));
}

void Store::NoteAvailability(const std::vector<LookedAt>& scans) {
  for (const LookedAt& scan : scans) {
    SetUnavailable(scan.id, scan.before, scan.now);
    recovery_.lost_scans += scan.before.empty() && !scan.now.empty() ? 1 : 0;
    recovery_.attached_scans += !scan.before.empty() && scan.now.empty() ? 1 : 0;
    recovery_.broken_references += scan.is_approved && !scan.now.empty() ? 1 : 0;
  }
}

/// A database that was lost must not pass for a new one: every scan would be an orphan.
void Store::RefuseScansOfAnother() {
  {
    Statement version = write_->Prepare("PRAGMA user_version");
    if (version.Step() && version.Integer(0) != 0) return;
  }
  std::vector<fs::path> folders = ScanFolders();
  std::erase_if(folders, [](const fs::path& folder) {
    return IsStaging(folder);
  });  // what had not become a scan is nobody's loss
  if (folders.empty()) return;
  throw DatabaseCorrupt(
      fmt::format("the database {} is empty or missing, but there are scans of another one ({} and "
                  "{} more): put a backup of the database in "
                  "its place, or move the folder {} away too to begin anew",
                  (folder_ / "plumb.db").string(), folders.front().string(), folders.size() - 1,
                  (folder_ / "scans").string()));
}

std::vector<fs::path> Store::ScanFolders() const {
  std::vector<fs::path> folders;
  std::error_code error;
  const fs::path scans = folder_ / "scans";
  fs::directory_iterator entry(scans, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    if (IsStaging(entry->path()) || store::ParseId(entry->path().filename().string()))
      folders.push_back(entry->path());
  }
  if (error && error != std::errc::no_such_file_or_directory) {
    throw DiskRefused(fmt::format("cannot list {}: {}; is its disk mounted and whole?",
                                  scans.string(), error.message()));
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

void Store::CollectOrphans() {
  for (const fs::path& folder : ScanFolders()) CollectOrphan(folder);
}

/// What a crash or a removal left goes; what no row explains is kept.
void Store::CollectOrphan(const fs::path& folder) {
  if (IsStaging(folder)) return Discard(folder, "of a scan that had not ended");
  const std::string name = folder.filename().string();
  const std::int64_t id = store::ParseId(name).value_or(0);
  std::string outcome, failure;
  {
    Statement query =
        write_->Prepare("SELECT outcome, has_folder, failure FROM scans WHERE id = ?");
    if (query.Bind(id).Step()) {
      if (query.Integer(1) != 0) return;
      outcome = query.Text(0);
      failure = query.Text(2);
    }
  }
  if (outcome.empty()) {
    Statement query = write_->Prepare("SELECT 1 FROM removed_scans WHERE id = ?");
    if (query.Bind(id).Step()) return Discard(folder, "of a scan that was removed");
    return SetAside(folder, name, "no scan of this number is known: is it of another database?");
  }
  if (failure == store::kInterrupted) {  // an older database may not know that the scan had ended
    return SetAside(folder, name + store::kInterruptedSuffix,
                    "it is complete, but its scan was never noted as done");
  }
  if (outcome == "failed" || outcome == "cancelled")
    Discard(folder,
            fmt::format("of a scan that {}", outcome == "failed" ? "failed" : "was discarded"));
}

void Store::Discard(const fs::path& folder, const std::string& why) {
  std::error_code error;
  fs::remove_all(folder, error);
  if (error) return;  // the next start tries again
  ++recovery_.orphaned_folders;
  Transaction transaction(*write_);
  Write(store::kSelf, "folder.remove", folder.filename().string(), why);
  transaction.Commit();
}

/// Its number may be given to another scan. Where scans/ is a disk of its own it stays on that.
void Store::SetAside(const fs::path& folder, const std::string& name, const std::string& why) {
  std::error_code error;
  fs::path target;
  for (const fs::path& aside : {folder_ / "set-aside", folder_ / "scans" / "set-aside"}) {
    fs::create_directories(aside, error);
    target = aside / name;
    for (int i = 2; fs::exists(target, error); ++i) target = aside / fmt::format("{}-{}", name, i);
    fs::rename(folder, target, error);
    if (error != std::errc::cross_device_link) break;
  }
  if (error) throw DiskRefused(DescribeWriteError(target, error.value()));
  ++recovery_.foreign_folders;
  Transaction transaction(*write_);
  Write(store::kSelf, "folder.set_aside", target.filename().string(), why);
  transaction.Commit();
}

}  // namespace plumb
