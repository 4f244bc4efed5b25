// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/ros_database.hpp"

#include <sqlite3.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/importers/unpack.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

/// SQLite's view of the recording: one file that can only be read. Through it, SQLite opens nothing
/// by name, so that no journal beside a hostile file is replayed.
class RecordingAsFile {
 public:
  explicit RecordingAsFile(FileBytes bytes)
      : bytes_(std::move(bytes)),
        name_("plumb-" + std::to_string(reinterpret_cast<std::uintptr_t>(this))) {
    vfs_.iVersion = 1;
    vfs_.szOsFile = sizeof(Opened);
    vfs_.mxPathname = 64;
    vfs_.zName = name_.c_str();
    vfs_.pAppData = this;
    vfs_.xOpen = &Open;
    vfs_.xDelete = [](sqlite3_vfs*, const char*, int) { return SQLITE_READONLY; };
    vfs_.xAccess = [](sqlite3_vfs*, const char*, int, int* exists) {
      *exists = 0;
      return SQLITE_OK;
    };
    vfs_.xFullPathname = [](sqlite3_vfs*, const char* name, int size, char* full) {
      sqlite3_snprintf(size, full, "%s", name);
      return SQLITE_OK;
    };
    vfs_.xRandomness = [](sqlite3_vfs*, int size, char* out) {
      std::fill_n(out, size, '\0');
      return size;
    };
    vfs_.xSleep = [](sqlite3_vfs*, int us) { return us; };
    vfs_.xCurrentTime = [](sqlite3_vfs*, double* day) {
      *day = 0;
      return SQLITE_OK;
    };
    vfs_.xGetLastError = [](sqlite3_vfs*, int, char*) { return 0; };
    sqlite3_vfs_register(&vfs_, 0);
  }
  RecordingAsFile(const RecordingAsFile&) = delete;
  RecordingAsFile& operator=(const RecordingAsFile&) = delete;
  ~RecordingAsFile() { sqlite3_vfs_unregister(&vfs_); }

  [[nodiscard]] const char* name() const { return name_.c_str(); }

 private:
  struct Opened {
    sqlite3_file base;
    RecordingAsFile* file;
  };
  static int Open(sqlite3_vfs* vfs, const char*, sqlite3_file* file, int flags, int* out_flags) {
    file->pMethods = nullptr;
    if ((flags & SQLITE_OPEN_MAIN_DB) == 0) return SQLITE_CANTOPEN;
    reinterpret_cast<Opened*>(file)->file = static_cast<RecordingAsFile*>(vfs->pAppData);
    file->pMethods = &Methods();
    if (out_flags != nullptr) *out_flags = SQLITE_OPEN_READONLY;
    return SQLITE_OK;
  }
  static int Read(sqlite3_file* file, void* to, int count, sqlite3_int64 offset) {
    const FileBytes& bytes = reinterpret_cast<Opened*>(file)->file->bytes_;
    const auto begin = static_cast<std::uint64_t>(offset);
    const auto wanted = static_cast<std::uint64_t>(count);
    const std::uint64_t there = begin < bytes.size ? std::min(wanted, bytes.size - begin) : 0;
    const std::span<std::uint8_t> out(static_cast<std::uint8_t*>(to),
                                      static_cast<std::size_t>(count));
    if (!bytes.read(begin, out.first(static_cast<std::size_t>(there)))) return SQLITE_IOERR_READ;
    // Bytes 18 and 19 say whether a log of writes lies beside the file: none is read.
    for (std::uint64_t at = 18; at < 20; ++at)
      if (at >= begin && at - begin < there) out[static_cast<std::size_t>(at - begin)] = 1;
    if (there == wanted) return SQLITE_OK;
    std::ranges::fill(out.subspan(static_cast<std::size_t>(there)), std::uint8_t{0});
    return SQLITE_IOERR_SHORT_READ;
  }
  static const sqlite3_io_methods& Methods() {
    static const sqlite3_io_methods methods = [] {
      sqlite3_io_methods m{};
      m.iVersion = 1;
      m.xClose = [](sqlite3_file*) { return SQLITE_OK; };
      m.xRead = &Read;
      m.xWrite = [](sqlite3_file*, const void*, int, sqlite3_int64) { return SQLITE_READONLY; };
      m.xTruncate = [](sqlite3_file*, sqlite3_int64) { return SQLITE_READONLY; };
      m.xSync = [](sqlite3_file*, int) { return SQLITE_OK; };
      m.xFileSize = [](sqlite3_file* file, sqlite3_int64* size) {
        *size = static_cast<sqlite3_int64>(reinterpret_cast<Opened*>(file)->file->bytes_.size);
        return SQLITE_OK;
      };
      m.xLock = [](sqlite3_file*, int) { return SQLITE_OK; };
      m.xUnlock = [](sqlite3_file*, int) { return SQLITE_OK; };
      m.xCheckReservedLock = [](sqlite3_file*, int* held) {
        *held = 0;
        return SQLITE_OK;
      };
      m.xFileControl = [](sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; };
      m.xSectorSize = [](sqlite3_file*) { return 512; };
      m.xDeviceCharacteristics = [](sqlite3_file*) { return SQLITE_IOCAP_IMMUTABLE; };
      return m;
    }();
    return methods;
  }

  FileBytes bytes_;
  std::string name_;
  sqlite3_vfs vfs_{};
};

using Database = std::unique_ptr<sqlite3, decltype(&sqlite3_close)>;
using Statement = std::unique_ptr<sqlite3_stmt, decltype(&sqlite3_finalize)>;

std::span<const std::uint8_t> Blob(sqlite3_stmt* statement, int column) {
  const void* data = sqlite3_column_blob(statement, column);
  if (data == nullptr) return {};
  return {static_cast<const std::uint8_t*>(data),
          static_cast<std::size_t>(sqlite3_column_bytes(statement, column))};
}

std::string TextOf(sqlite3_stmt* statement, int column) {
  const auto bytes = Blob(statement, column);
  return {bytes.begin(), bytes.end()};
}

class RosDatabase : public RosMessages {
 public:
  explicit RosDatabase(FileBytes bytes)
      : file_(std::move(bytes)), database_(nullptr, &sqlite3_close) {
    sqlite3* opened = nullptr;
    const int code = sqlite3_open_v2("recording", &opened,
                                     SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, file_.name());
    database_.reset(opened);
    if (code != SQLITE_OK) throw DataError(say::foreign::DatabaseDamaged());
    // What a file of messages never needs, and what a hostile one could use.
    for (const int off : {SQLITE_DBCONFIG_TRUSTED_SCHEMA, SQLITE_DBCONFIG_ENABLE_TRIGGER,
                          SQLITE_DBCONFIG_ENABLE_VIEW})
      sqlite3_db_config(opened, off, 0, nullptr);
    sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, static_cast<int>(kMostChunkBytes));
    sqlite3_limit(opened, SQLITE_LIMIT_VDBE_OP, 10'000);
    const Statement tables = Prepared(
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', "
        "'messages')");
    if (!Step(tables) || sqlite3_column_int(tables.get(), 0) != 2)
      throw DataError(say::foreign::DatabaseOther());
  }
  [[nodiscard]] const char* format() const override { return "ROS 2 .db3"; }
  void ForEach(const Visit& visit) override;
  [[nodiscard]] std::span<const std::uint8_t> Read(const RosMessage& message) override;

 private:
  [[nodiscard]] Statement Prepared(const char* sql) const {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database_.get(), sql, -1, &statement, nullptr) != SQLITE_OK)
      throw DataError(say::foreign::DatabaseDamaged());
    return {statement, &sqlite3_finalize};
  }
  /// @return whether there is a row.
  static bool Step(const Statement& statement) {
    const int code = sqlite3_step(statement.get());
    if (code != SQLITE_ROW && code != SQLITE_DONE) throw DataError(say::foreign::DatabaseDamaged());
    return code == SQLITE_ROW;
  }
  /// rosbag2 may pack each message; only metadata.yaml beside the file says so.
  static std::vector<std::uint8_t> Unpacked(std::span<const std::uint8_t> data) {
    constexpr std::array<std::uint8_t, 4> kZstd = {0x28, 0xb5, 0x2f, 0xfd};
    if (data.size() < 4 || !std::equal(kZstd.begin(), kZstd.end(), data.begin()))
      return {data.begin(), data.end()};
    const unsigned long long size = ZSTD_getFrameContentSize(data.data(), data.size());
    if (size > kMostChunkBytes) throw DataError(say::foreign::BagPacking());
    std::vector<std::uint8_t> unpacked(static_cast<std::size_t>(size));
    UnpackZstd(data, unpacked);
    return unpacked;
  }

  RecordingAsFile file_;
  Database database_;
  UnpackedChunks unpacked_;
};

void RosDatabase::ForEach(const Visit& visit) {
  std::map<std::int64_t, RosTopic> topics;
  const Statement listed = Prepared("SELECT id, name, type, serialization_format FROM topics");
  while (Step(listed)) {
    RosTopic topic{
        .name = TextOf(listed.get(), 1), .type = TextOf(listed.get(), 2), .is_cdr = true};
    if (const std::size_t part = topic.type.find("/msg/"); part != std::string::npos)
      topic.type.erase(part, 4);
    if (TextOf(listed.get(), 3) != "cdr") continue;
    if (topics.size() >= kMostTopics) throw DataError(say::foreign::BagField());
    topics.try_emplace(sqlite3_column_int64(listed.get(), 0), std::move(topic));
  }
  const Statement messages =
      Prepared("SELECT rowid, topic_id, timestamp, data FROM messages ORDER BY rowid");
  while (Step(messages)) {
    const auto topic = topics.find(sqlite3_column_int64(messages.get(), 1));
    if (topic == topics.end()) continue;
    const std::vector<std::uint8_t> data = Unpacked(Blob(messages.get(), 3));
    visit(topic->second,
          {.chunk = static_cast<std::uint64_t>(sqlite3_column_int64(messages.get(), 0)),
           .size = data.size(),
           .time_s = 1e-9 * static_cast<double>(sqlite3_column_int64(messages.get(), 2))},
          data);
  }
}

std::span<const std::uint8_t> RosDatabase::Read(const RosMessage& message) {
  return unpacked_.Read(message, [this](std::uint64_t row) {
    const Statement found = Prepared("SELECT data FROM messages WHERE rowid = ?");
    sqlite3_bind_int64(found.get(), 1, static_cast<sqlite3_int64>(row));
    if (!Step(found)) throw DataError(say::foreign::Unreadable());
    return Unpacked(Blob(found.get(), 0));
  });
}

}  // namespace

std::unique_ptr<RosMessages> OpenRosDatabase(FileBytes bytes) {
  return std::make_unique<RosDatabase>(std::move(bytes));
}

}  // namespace plumb
