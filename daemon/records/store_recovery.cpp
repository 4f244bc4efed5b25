// Opening the store, and what a crash left behind.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <set>

#include <fmt/format.h>

#include "daemon/files/scene_folder.hpp"
#include "daemon/records/schema.hpp"
#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

namespace fs = std::filesystem;
using store::ScanId;

namespace {

bool IsStaging(const fs::path& folder) {
  return folder.filename().string().starts_with(".staging-");
}

}  // namespace

Store::Store(const fs::path& folder) : folder_(fs::absolute(folder)) {
  std::error_code error;
  fs::create_directories(folder_ / "scans", error);
  if (error) throw DiskRefused(DescribeWriteError(folder_ / "scans", error.value()));
  CheckWritable();
  write_ = std::make_unique<Database>(folder_ / "plumb.db", Database::Access::kReadWrite);
  write_->CheckIntegrity();
  RefuseScansOfAnother();
  Migrate(*write_);
  read_ = std::make_unique<Database>(folder_ / "plumb.db", Database::Access::kReadOnly);
  list_ = std::make_unique<Database>(folder_ / "plumb.db", Database::Access::kReadOnly);
  Recover();
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
  {
    Transaction transaction(*write_);
    FailInterrupted();
    recovery_.interrupted_scans = write_->num_changed();
    transaction.Commit();
  }
  std::vector<std::int64_t> lost;
  {
    Statement query = write_->Prepare("SELECT id FROM scans WHERE has_folder = 1 ORDER BY id");
    while (query.Step()) {
      if (!IsSceneFolder(ScanFolder(ScanId(query.Integer(0))) / "scene"))
        lost.push_back(query.Integer(0));
    }
  }
  for (const std::int64_t id : lost) {
    Statement query =
        write_->Prepare("SELECT 1 FROM refs WHERE scan_id = ? AND approved_by <> '' LIMIT 1");
    if (query.Bind(id).Step()) {
      ++recovery_.broken_references;  // its row stays as it is: a backup of the files makes it
                                      // whole again
      continue;
    }
    write_->Prepare("UPDATE scans SET has_folder = 0, failure = 'its files are gone' WHERE id = ?")
        .Bind(id)
        .Run();
    ++recovery_.lost_scans;
  }
  CollectOrphans();
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
  for (fs::directory_iterator entry(folder_ / "scans", error), end; !error && entry != end;
       entry.increment(error)) {
    if (IsStaging(entry->path()) || store::ParseId(entry->path().filename().string()))
      folders.push_back(entry->path());
  }
  return folders;
}

/// Removes what a crash or a removal left. Folders that this database has never given a number to
/// are not ours to remove: it may be an older backup.
void Store::CollectOrphans() {
  std::set<std::string> known;
  {
    Statement query = write_->Prepare("SELECT id FROM scans WHERE has_folder = 1");
    while (query.Step()) known.insert(ScanId(query.Integer(0)));
  }
  std::int64_t last = 0;
  {
    Statement query = write_->Prepare("SELECT seq FROM sqlite_sequence WHERE name = 'scans'");
    if (query.Step()) last = query.Integer(0);
  }
  for (const fs::path& folder : ScanFolders()) {
    const std::string name = folder.filename().string();
    if (known.contains(name)) continue;
    if (store::ParseId(name).value_or(0) > last) {
      SetAside(folder);
      ++recovery_.foreign_folders;
    } else {
      std::error_code ignored;
      fs::remove_all(folder, ignored);
      ++recovery_.orphaned_folders;
    }
  }
}

/// Its number will be given to another scan.
void Store::SetAside(const fs::path& folder) {
  const fs::path aside = folder_ / "set-aside";
  std::error_code error;
  fs::create_directories(aside, error);
  fs::path target = aside / folder.filename();
  for (int i = 2; fs::exists(target, error); ++i)
    target = aside / fmt::format("{}-{}", folder.filename().string(), i);
  fs::rename(folder, target, error);
  if (error) throw DiskRefused(DescribeWriteError(target, error.value()));
}

}  // namespace plumb
