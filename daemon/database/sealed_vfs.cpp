// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/sealed_vfs.hpp"

#include <sqlite3.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <utility>

#include "daemon/database/database_mark.hpp"
#include "daemon/database/kept_pages.hpp"
#include "daemon/database/page_seals.hpp"
#include "daemon/database/sealed_pages.hpp"

namespace plumb {
namespace {

thread_local std::uint32_t t_unsealed_page = 0;

/// An open file as SQLite sees it; the underlying system's file follows in the same allocation.
struct SealedFile : sqlite3_file {
  const char* name;          ///< Owned by SQLite, valid until the file is closed.
  std::uint32_t frame_page;  ///< Of the frame whose header was written last.
  bool frame_commits;        ///< That frame is the last one of a change.
  DatabaseMark mark;         ///< Of the change that is being written; 0: it has no page 1 yet.
  bool is_committed;         ///< All of that change is in the log; the next sync confirms it.
  int seals;                 ///< Of a database: the open list of page_seals.hpp, or -1.
  std::shared_ptr<KeptPages> kept;  ///< Null: everything is read from the disk.
};

sqlite3_file* Below(sqlite3_file* file) {
  return reinterpret_cast<sqlite3_file*>(static_cast<SealedFile*>(file) + 1);
}

int Unsealed(std::uint32_t page) {
  t_unsealed_page = page;
  return SQLITE_IOERR_DATA;
}

ConstPage AsPage(const void* bytes) {
  return ConstPage(static_cast<const std::uint8_t*>(bytes), kPageBytes);
}

/// Fails unless the whole page is in the file and its checksum is right. Any page of an empty file
/// is SQLITE_IOERR_SHORT_READ. @param number  From 1
int ReadPage(const SealedFile& database, sqlite3_file* below, void* page, std::uint32_t number) {
  const int code = below->pMethods->xRead(below, page, static_cast<int>(kPageBytes),
                                          (sqlite3_int64{number} - 1) * sqlite3_int64{kPageBytes});
  if (code == SQLITE_IOERR_SHORT_READ) {
    sqlite3_int64 size = 0;
    if (below->pMethods->xFileSize(below, &size) == SQLITE_OK && size == 0) return code;
    return Unsealed(number);
  }
  if (code != SQLITE_OK) return code;
  const bool is_last =
      database.seals < 0 || IsLastSeal(database.seals, number, SealIn(AsPage(page)));
  return is_last && IsSealed(AsPage(page), number) ? SQLITE_OK : Unsealed(number);
}

int ReadDatabase(sqlite3_file* file, void* bytes, int amount, sqlite3_int64 offset) {
  // SQLite looks at the beginning of the file before it looks for page 1, which the log may have.
  constexpr int kFileHeaderBytes = 100;
  if (offset + amount <= kFileHeaderBytes)
    return Below(file)->pMethods->xRead(Below(file), bytes, amount, offset);
  const auto number = static_cast<std::uint32_t>(offset / sqlite3_int64{kPageBytes}) + 1;
  if (amount != static_cast<int>(kPageBytes) || offset % sqlite3_int64{kPageBytes} != 0)
    return Unsealed(number);
  const auto& database = *static_cast<SealedFile*>(file);
  if (database.kept && database.kept->Get(offset, bytes)) return SQLITE_OK;
  const int code = ReadPage(database, Below(file), bytes, number);
  if (code == SQLITE_OK && database.kept) database.kept->Put(offset, bytes);
  return code;
}

/// Keeps a page that was written, or forgets one that could not be.
int Keep(const SealedFile& file, sqlite3_int64 offset, const void* page, int code) {
  if (file.kept && code == SQLITE_OK) file.kept->Put(offset, page);
  if (file.kept && code != SQLITE_OK) file.kept->Drop(offset);
  return code;
}

int WriteDatabase(sqlite3_file* file, const void* bytes, int amount, sqlite3_int64 offset) {
  if (amount != static_cast<int>(kPageBytes) || offset % sqlite3_int64{kPageBytes} != 0)
    return SQLITE_IOERR_WRITE;  // only whole pages can be sealed
  std::array<std::uint8_t, kPageBytes> page;
  std::memcpy(page.data(), bytes, kPageBytes);
  const auto number = static_cast<std::uint32_t>(offset / sqlite3_int64{kPageBytes}) + 1;
  SealPage(page, number);
  const auto& database = *static_cast<SealedFile*>(file);
  if (database.seals >= 0 && !NoteSeal(database.seals, number, SealIn(page)))
    return SQLITE_IOERR_WRITE;
  sqlite3_file* const below = Below(file);
  return Keep(database, offset, page.data(),
              below->pMethods->xWrite(below, page.data(), amount, offset));
}

/// A frame's page is as it was written if the sum of the frame before, continued over this frame's
/// header and page, is the sum in its header.
int ReadLog(sqlite3_file* file, void* bytes, int amount, sqlite3_int64 offset) {
  sqlite3_file* const below = Below(file);
  KeptPages* const kept = static_cast<SealedFile*>(file)->kept.get();
  const bool is_page = amount == static_cast<int>(kPageBytes);
  if (is_page && kept != nullptr && kept->Get(offset, bytes)) return SQLITE_OK;
  const auto read = below->pMethods->xRead;
  if (const int code = read(below, bytes, amount, offset); code != SQLITE_OK) return code;
  constexpr sqlite3_int64 kFrameBytes = kFrameHeaderBytes + kPageBytes;
  const sqlite3_int64 frame_at = offset - sqlite3_int64{kFrameHeaderBytes};
  if (!is_page || frame_at < sqlite3_int64{kLogHeaderBytes} ||
      (frame_at - sqlite3_int64{kLogHeaderBytes}) % kFrameBytes != 0)
    return SQLITE_OK;  // a header, or a whole frame, whose sum SQLite compares
  std::array<std::uint8_t, kFrameHeaderBytes> header;
  std::array<std::uint8_t, sizeof(LogSum)> before;
  constexpr std::size_t kSumAt = 16;  // in the header of a frame
  const bool is_first = frame_at == sqlite3_int64{kLogHeaderBytes};
  const sqlite3_int64 before_at = is_first ? sqlite3_int64{kLogHeaderBytes - sizeof(LogSum)}
                                           : frame_at - kFrameBytes + sqlite3_int64{kSumAt};
  if (const int code = read(below, header.data(), static_cast<int>(header.size()), frame_at);
      code != SQLITE_OK)
    return code;
  if (const int code = read(below, before.data(), static_cast<int>(before.size()), before_at);
      code != SQLITE_OK)
    return code;
  LogSum sum = LogSum::At(before.data());
  sum.Add(std::span(header).first(8));
  sum.Add(AsPage(bytes));
  if (!(sum == LogSum::At(header.data() + kSumAt))) return Unsealed(0);
  if (kept != nullptr) kept->Put(offset, bytes);
  return SQLITE_OK;
}

int WriteLog(sqlite3_file* file, const void* bytes, int amount, sqlite3_int64 offset) {
  auto& log = *static_cast<SealedFile*>(file);
  const auto* const written = static_cast<const std::uint8_t*>(bytes);
  const bool is_page = amount == static_cast<int>(kPageBytes);
  int code = Below(file)->pMethods->xWrite(Below(file), bytes, amount, offset);
  if (is_page) code = Keep(log, offset, bytes, code);
  if (code != SQLITE_OK) {  // the change is rolled back: a later sync must not confirm it
    log.mark = {};
    log.is_committed = false;
  } else if (amount == static_cast<int>(kFrameHeaderBytes)) {
    constexpr std::size_t kCommitAt = 4;
    log.frame_page = BigEndian32(written);
    log.frame_commits = BigEndian32(written + kCommitAt) != 0;
  } else if (is_page) {
    if (log.frame_page == 1) log.mark = {.changes = BigEndian32(written + kChangesAt)};
    log.is_committed = log.frame_commits && log.mark.changes != 0;
  }
  return code;
}

int SyncLog(sqlite3_file* file, int flags) {
  auto& log = *static_cast<SealedFile*>(file);
  const int code = Below(file)->pMethods->xSync(Below(file), flags);
  // Also a change that could not be synced is rolled back.
  const DatabaseMark mark = std::exchange(log.mark, {});
  if (!std::exchange(log.is_committed, false) || code != SQLITE_OK) return code;
  const std::string name = log.name;
  WriteMark(name.substr(0, name.size() - std::strlen("-wal")), mark);
  return code;
}

/// SQLite syncs the database before it lets go of the log of writes, so up to then a list, or a
/// page, that has not reached the disk is written again from the log. All changes that are in the
/// database by now have been confirmed, so that the mark, too, can be made to last.
int SyncDatabase(sqlite3_file* file, int flags) {
  const auto& database = *static_cast<SealedFile*>(file);
  if (database.seals >= 0 && ::fdatasync(database.seals) != 0) return SQLITE_IOERR_FSYNC;
  if (database.seals >= 0) SyncMark(database.name);
  return Below(file)->pMethods->xSync(Below(file), flags);
}

int Close(sqlite3_file* file) {
  auto& sealed = *static_cast<SealedFile*>(file);
  if (sealed.seals >= 0) ::close(std::exchange(sealed.seals, -1));
  sealed.kept.reset();
  return Below(file)->pMethods->xClose(Below(file));
}
int Truncate(sqlite3_file* file, sqlite3_int64 size) {
  if (const auto& kept = static_cast<SealedFile*>(file)->kept) kept->DropFrom(size);
  return Below(file)->pMethods->xTruncate(Below(file), size);
}
int FileSize(sqlite3_file* file, sqlite3_int64* size) {
  return Below(file)->pMethods->xFileSize(Below(file), size);
}
int Lock(sqlite3_file* file, int lock) { return Below(file)->pMethods->xLock(Below(file), lock); }
int Unlock(sqlite3_file* file, int lock) {
  return Below(file)->pMethods->xUnlock(Below(file), lock);
}
int CheckReservedLock(sqlite3_file* file, int* is_held) {
  return Below(file)->pMethods->xCheckReservedLock(Below(file), is_held);
}
int FileControl(sqlite3_file* file, int what, void* value) {
  return Below(file)->pMethods->xFileControl(Below(file), what, value);
}
int SectorSize(sqlite3_file* file) { return Below(file)->pMethods->xSectorSize(Below(file)); }
int DeviceCharacteristics(sqlite3_file* file) {
  return Below(file)->pMethods->xDeviceCharacteristics(Below(file));
}
int ShmMap(sqlite3_file* file, int page, int size, int extend, void volatile** mapped) {
  return Below(file)->pMethods->xShmMap(Below(file), page, size, extend, mapped);
}
int ShmLock(sqlite3_file* file, int offset, int n, int flags) {
  return Below(file)->pMethods->xShmLock(Below(file), offset, n, flags);
}
void ShmBarrier(sqlite3_file* file) { Below(file)->pMethods->xShmBarrier(Below(file)); }
int ShmUnmap(sqlite3_file* file, int remove) {
  return Below(file)->pMethods->xShmUnmap(Below(file), remove);
}

// Version 2: without xFetch, so that no page is read past this layer by a mapping.
constexpr sqlite3_io_methods Methods(decltype(sqlite3_io_methods::xRead) read,
                                     decltype(sqlite3_io_methods::xWrite) write,
                                     decltype(sqlite3_io_methods::xSync) sync) {
  sqlite3_io_methods methods{};
  methods.iVersion = 2;
  methods.xClose = Close;
  methods.xRead = read;
  methods.xWrite = write;
  methods.xTruncate = Truncate;
  methods.xSync = sync;
  methods.xFileSize = FileSize;
  methods.xLock = Lock;
  methods.xUnlock = Unlock;
  methods.xCheckReservedLock = CheckReservedLock;
  methods.xFileControl = FileControl;
  methods.xSectorSize = SectorSize;
  methods.xDeviceCharacteristics = DeviceCharacteristics;
  methods.xShmMap = ShmMap;
  methods.xShmLock = ShmLock;
  methods.xShmBarrier = ShmBarrier;
  methods.xShmUnmap = ShmUnmap;
  return methods;
}
constexpr sqlite3_io_methods kDatabaseMethods = Methods(ReadDatabase, WriteDatabase, SyncDatabase);
constexpr sqlite3_io_methods kLogMethods = Methods(ReadLog, WriteLog, SyncLog);

struct System {
  std::string name;
  sqlite3_vfs* below = nullptr;
  sqlite3_vfs vfs{};
};

int Open(sqlite3_vfs* vfs, const char* name, sqlite3_file* file, int flags, int* flags_given) {
  auto* const below = static_cast<System*>(vfs->pAppData)->below;
  const bool is_database = (flags & SQLITE_OPEN_MAIN_DB) != 0;
  if (!is_database && (flags & SQLITE_OPEN_WAL) == 0)
    return below->xOpen(below, name, file, flags, flags_given);
  auto* const sealed = new (file) SealedFile{};
  sealed->name = name;
  sealed->seals = -1;
  const int code = below->xOpen(below, name, Below(file), flags, flags_given);
  // SQLite closes a file that could not be opened if it has methods.
  if (Below(file)->pMethods == nullptr) return code;
  sealed->pMethods = is_database ? &kDatabaseMethods : &kLogMethods;
  // With a name of SQLite's own, a log has the parameters of its database.
  if (sqlite3_uri_boolean(name, kKeepPages, 0) != 0) sealed->kept = KeptPages::Of(name);
  if (!is_database) return code;
  const bool writes = (flags & SQLITE_OPEN_READWRITE) != 0;
  sealed->seals = OpenSeals(name, writes);
  // A list that is not kept up would accuse every page that is written from now on.
  if (sealed->seals < 0 && writes && HasSeals(name)) return SQLITE_CANTOPEN;
  return code;
}

}  // namespace

const char* SealedSystem(const char* system) {
  static std::mutex mutex;
  static std::map<std::string, System, std::less<>> systems;
  const std::lock_guard lock(mutex);
  const auto [found, is_new] = systems.try_emplace(system);
  System& sealed = found->second;
  if (is_new) {
    sealed.name = std::string("plumb-") + system;
    sealed.below = sqlite3_vfs_find(system);
    sealed.vfs = *sealed.below;
    sealed.vfs.zName = sealed.name.c_str();
    sealed.vfs.pAppData = &sealed;
    sealed.vfs.pNext = nullptr;
    sealed.vfs.szOsFile += static_cast<int>(sizeof(SealedFile));
    sealed.vfs.xOpen = Open;
    sqlite3_vfs_register(&sealed.vfs, /*makeDflt=*/0);
  }
  return sealed.name.c_str();
}

std::uint32_t LastUnsealedPage() { return t_unsealed_page; }

}  // namespace plumb
