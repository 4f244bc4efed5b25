// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/database.hpp"

#include <sodium.h>
#include <sqlite3.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <random>
#include <utility>

#include <fmt/format.h>

#include "daemon/database/examination.hpp"
#include "daemon/database/page_seals.hpp"
#include "daemon/database/sealed_pages.hpp"
#include "daemon/database/sealed_vfs.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

std::string UriOf(const std::filesystem::path& file) {
  std::string uri = "file:";
  for (const char c : file.string()) {
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      uri += c;
    }
  }
  return uri;
}

/// The file's name as a URI, with the options that SQLite needs for such a disk.
std::string UriOf(const std::filesystem::path& file, Database::Access access) {
  std::string uri = UriOf(file);
  // A database that was closed cleanly has no write-ahead log, and none can be created.
  std::error_code error;
  if (access == Database::Access::kFrozen &&
      !std::filesystem::exists(file.string() + "-wal", error))
    uri += "?immutable=1";
  if (access == Database::Access::kReadWrite || access == Database::Access::kReadOnly)
    uri += std::string("?") + kKeepPages + "=1";
  return uri;
}

/// For a new database, and for copies by VACUUM. To be called after the page size is set, which
/// resets it.
void ReserveSeals(sqlite3* handle) {
  int reserved = static_cast<int>(kSealBytes);
  sqlite3_file_control(handle, "main", SQLITE_FCNTL_RESERVE_BYTES, &reserved);
}

/// The number of a database's first change. It is random: a log of writes whose numbers do not
/// follow on from it belongs to another database.
std::uint32_t FirstChange() {
  constexpr std::uint32_t kLargest = 1U << 30U;
  std::random_device device;
  return std::uniform_int_distribution<std::uint32_t>(1, kLargest)(device);
}

/// Adds checksums to a database of 0.2.0 or older.
/// @throws IoError and its kinds; the old database is then still in place.
void ConvertToSealed(const std::filesystem::path& file, std::chrono::milliseconds busy_wait) {
  const std::filesystem::path folder = file.parent_path(), kept = folder / kBeforeChecksums,
                              made = file.string() + "-sealing";
  const auto place = [](const std::filesystem::path& from, const std::filesystem::path& to) {
    if (::rename(from.c_str(), to.c_str()) != 0) throw DiskRefused(DescribeWriteError(to, errno));
  };
  std::error_code error;
  std::filesystem::remove(made, error);
  {
    Database old(file, Database::Access::kUnsealed, busy_wait);
    old.CheckIntegrity();
    std::filesystem::create_directories(kept, error);
    if (error) throw DiskRefused(DescribeWriteError(kept, error.value()));
    std::filesystem::permissions(kept,
                                 std::filesystem::perms::owner_all |
                                     std::filesystem::perms::group_read |
                                     std::filesystem::perms::group_exec,
                                 error);
    const std::filesystem::path copy = kept / (std::string(kDatabaseFile) + "-copy");
    std::filesystem::remove(copy, error);
    old.CopyTo(copy);
    SyncToDisk(copy);
    place(copy, kept / kDatabaseFile);
    SyncToDisk(kept);
    old.WriteSealed(made);
    // The log of the old database must not be found beside the new one.
    if (!old.Checkpoint()) throw DatabaseBusy(say::store::FolderInUse(folder.string()));
  }
  if (KindOfDatabase(made) != DatabaseKind::kSealed)
    throw DatabaseCorrupt(say::store::DatabaseUnsealed(made.string()));
  Database(made, Database::Access::kFrozen).CheckIntegrity();
  SyncToDisk(made);
  std::filesystem::remove(file.string() + kSealsSuffix, error);  // of another database
  place(made, file);
  SyncToDisk(folder);
}

/// Examines the database, converts one of 0.2.0 if it is opened for changes, and returns whether
/// its pages now carry checksums.
bool Examined(const std::filesystem::path& file, Database::Access access,
              std::chrono::milliseconds busy_wait) {
  if (access == Database::Access::kUnsealed) {
    (void)ExamineDatabase(file);
    return false;
  }
  const DatabaseKind kind =
      access == Database::Access::kReadOnly || access == Database::Access::kFromDisk
          ? KindOfDatabase(file)
          : ExamineDatabase(file);
  if (access != Database::Access::kReadWrite) return kind != DatabaseKind::kPlain;
  if (kind == DatabaseKind::kPlain) ConvertToSealed(file, busy_wait);
  MakeSeals(file);
  return true;
}

constexpr int kAnyNumber = -1;

/// The length before each value keeps ("ab", "c") and ("a", "bc") apart. The text of a number is
/// SQLite's own.
void AddValue(crypto_auth_hmacsha256_state& state, sqlite3_value* value) {
  const int type = sqlite3_value_type(value);
  const unsigned char* const text = sqlite3_value_text(value);
  const int length = text == nullptr ? 0 : sqlite3_value_bytes(value);
  const std::string head = fmt::format("{}:{}:", type, length);
  crypto_auth_hmacsha256_update(&state, reinterpret_cast<const unsigned char*>(head.data()),
                                head.size());
  if (length > 0) crypto_auth_hmacsha256_update(&state, text, static_cast<std::size_t>(length));
}

void KeyedDigest(sqlite3_context* context, int num_values, sqlite3_value** values) {
  const auto& key = *static_cast<const std::string*>(sqlite3_user_data(context));
  crypto_auth_hmacsha256_state state;
  crypto_auth_hmacsha256_init(&state, reinterpret_cast<const unsigned char*>(key.data()),
                              key.size());
  for (int i = 0; i < num_values; ++i) AddValue(state, values[i]);
  std::array<unsigned char, crypto_auth_hmacsha256_BYTES> code{};
  crypto_auth_hmacsha256_final(&state, code.data());
  std::array<char, 2 * crypto_auth_hmacsha256_BYTES + 1> hex{};
  sqlite3_result_text(context, sodium_bin2hex(hex.data(), hex.size(), code.data(), code.size()), -1,
                      SQLITE_TRANSIENT);
}

}  // namespace

Statement::~Statement() {
  if (statement_ == nullptr) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
  if (*idle_ == nullptr) {
    *idle_ = statement_;
  } else {
    sqlite3_finalize(statement_);  // the same statement was in use twice
  }
}

Statement::Statement(Statement&& other) noexcept
    : database_(other.database_),
      idle_(other.idle_),
      statement_(std::exchange(other.statement_, nullptr)),
      next_(other.next_) {}

Statement& Statement::Bind(std::int64_t value) {
  if (const int code = sqlite3_bind_int64(statement_, next_++, value); code != SQLITE_OK)
    database_->Fail(code, "use");
  return *this;
}

Statement& Statement::Bind(double value) {
  if (const int code = sqlite3_bind_double(statement_, next_++, value); code != SQLITE_OK)
    database_->Fail(code, "use");
  return *this;
}

Statement& Statement::Bind(std::string_view value) {
  const int code =
      sqlite3_bind_text64(statement_, next_++, value.data() == nullptr ? "" : value.data(),
                          value.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
  if (code != SQLITE_OK) database_->Fail(code, "use");
  return *this;
}

Statement& Statement::BindNull() {
  if (const int code = sqlite3_bind_null(statement_, next_++); code != SQLITE_OK)
    database_->Fail(code, "use");
  return *this;
}

bool Statement::Step() {
  const int code = sqlite3_step(statement_);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE)
    database_->Fail(code, sqlite3_stmt_readonly(statement_) != 0 ? "read" : "write");
  return false;
}

void Statement::Run() {
  while (Step()) {
  }
}

bool Statement::IsNull(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}
std::int64_t Statement::Integer(int column) const {
  return sqlite3_column_int64(statement_, column);
}
double Statement::Real(int column) const { return sqlite3_column_double(statement_, column); }

std::string Statement::Text(int column) const {
  const unsigned char* text = sqlite3_column_text(statement_, column);
  if (text == nullptr) return {};
  return {reinterpret_cast<const char*>(text),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_, column))};
}

Database::Database(const std::filesystem::path& file, Access access,
                   std::chrono::milliseconds busy_wait)
    : file_(file), busy_wait_(busy_wait), is_sealed_(Examined(file, access, busy_wait)) {
  const bool writes = access == Access::kReadWrite || access == Access::kUnsealed;
  const int flags = writes ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY;
  // no locks; locks for this process only
  const char* const system = access == Access::kFrozen ? "unix-none" : "unix-excl";
  try {
    if (const int code = sqlite3_open_v2(UriOf(file, access).c_str(), &handle_,
                                         flags | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI,
                                         is_sealed_ ? SealedSystem(system) : system);
        code != SQLITE_OK) {
      Fail(code, "open");
    }
    sqlite3_extended_result_codes(handle_, 1);
    sqlite3_busy_timeout(handle_, static_cast<int>(busy_wait.count()));
    if (access == Access::kFrozen)
      Execute(
          "PRAGMA locking_mode = EXCLUSIVE");  // keeps the index of the write-ahead log in memory
    // A database file from elsewhere must not be able to run code.
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
    Execute("PRAGMA foreign_keys = ON; PRAGMA synchronous = FULL; PRAGMA secure_delete = ON;");
    if (writes) PrepareToWrite();
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

void Database::PrepareToWrite() {
  if (is_sealed_) {
    Execute(fmt::format("PRAGMA page_size = {}; PRAGMA cache_spill = OFF;", kPageBytes));
    ReserveSeals(handle_);
    if (Changes() == 0) Execute(fmt::format("PRAGMA application_id = {}", FirstChange()));
  }
  Execute("PRAGMA journal_mode = WAL; PRAGMA journal_size_limit = 4194304;");
}

std::int64_t Database::Changes() { return FirstInteger("PRAGMA application_id").value_or(0); }

/// Writes page 1, and so puts the number of the change into the log of writes, where the next start
/// looks for it.
void Database::CountChange() { Execute(fmt::format("PRAGMA application_id = {}", Changes() + 1)); }

bool Database::Checkpoint() {
  constexpr int kNoWait = 0;
  sqlite3_busy_timeout(handle_, kNoWait);
  const int code =
      sqlite3_wal_checkpoint_v2(handle_, "main", SQLITE_CHECKPOINT_TRUNCATE, nullptr, nullptr);
  sqlite3_busy_timeout(handle_, static_cast<int>(busy_wait_.count()));
  return code == SQLITE_OK;
}

void Database::UseKey(const std::string& key) {
  const int code = sqlite3_create_function_v2(
      handle_, "keyed_digest", kAnyNumber, SQLITE_UTF8 | SQLITE_DETERMINISTIC, new std::string(key),
      KeyedDigest, nullptr, nullptr, [](void* kept) { delete static_cast<std::string*>(kept); });
  if (code != SQLITE_OK) Fail(code, "set_up");
}

void Database::WriteSealed(const std::filesystem::path& file) {
  Execute(fmt::format("PRAGMA page_size = {}", kPageBytes));
  ReserveSeals(handle_);
  Run("VACUUM INTO ?", UriOf(file) + "?vfs=" + SealedSystem("unix-excl"));
}

Database::~Database() {
  for (const auto& [sql, statement] : idle_) sqlite3_finalize(statement);
  sqlite3_close(handle_);
}

void Database::Execute(const std::string& sql) {
  if (const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
      code != SQLITE_OK)
    Fail(code, "set_up");
}

Statement Database::Take(std::string_view sql) {
  auto idle = idle_.find(sql);
  if (idle != idle_.end() && idle->second != nullptr)
    return {*this, idle->second, std::exchange(idle->second, nullptr)};
  sqlite3_stmt* statement = nullptr;
  if (const int code = sqlite3_prepare_v3(handle_, sql.data(), static_cast<int>(sql.size()),
                                          SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
      code != SQLITE_OK) {
    Fail(code, "use");
  }
  if (idle == idle_.end()) idle = idle_.try_emplace(std::string(sql), nullptr).first;
  return {*this, idle->second, statement};
}

std::int64_t Database::last_id() const { return sqlite3_last_insert_rowid(handle_); }
int Database::num_changed() const { return sqlite3_changes(handle_); }

bool Database::CheckIntegrity(std::chrono::milliseconds limit) {
  using Clock = std::chrono::steady_clock;
  constexpr int kStepsBetween = 10'000;
  Clock::time_point end = Clock::now() + limit;
  sqlite3_progress_handler(
      handle_, kStepsBetween,
      [](void* until) { return Clock::now() > *static_cast<Clock::time_point*>(until) ? 1 : 0; },
      &end);
  std::string found;
  int code = SQLITE_OK;
  {
    Statement check = Prepare("PRAGMA integrity_check(3)");
    while ((code = sqlite3_step(check.statement_)) == SQLITE_ROW)
      found += (found.empty() ? "" : "; ") + check.Text(0);
  }
  sqlite3_progress_handler(handle_, 0, nullptr, nullptr);
  const bool is_cut_short = (code & 0xFF) == SQLITE_INTERRUPT;
  if (code != SQLITE_DONE && !is_cut_short) Fail(code, "read");
  if (found != "ok" && !(is_cut_short && found.empty())) {
    KeepLog();
    throw DatabaseCorrupt(say::store::DatabaseDamaged(file_.string(), found));
  }
  return !is_cut_short;
}

void Database::CopyTo(const std::filesystem::path& file) {
  sqlite3* copy = nullptr;
  int code = sqlite3_open_v2(file.c_str(), &copy,
                             SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX,
                             is_sealed_ ? SealedSystem("unix-excl") : nullptr);
  if (code == SQLITE_OK) {
    // In one step, because a write in between would restart it; in this mode of the log, readers do
    // not block other connections.
    sqlite3_backup* backup = sqlite3_backup_init(copy, "main", handle_, "main");
    code = backup == nullptr ? sqlite3_errcode(copy) : sqlite3_backup_step(backup, -1);
    const int end = backup == nullptr ? code : sqlite3_backup_finish(backup);
    if (code == SQLITE_DONE) code = end;
  }
  const std::string what = sqlite3_errstr(code);
  const int closed = sqlite3_close(copy);
  if (code == SQLITE_OK && closed == SQLITE_OK) return;
  // What is wrong with the database itself is no fault of the disk that the copy is on.
  if (code == SQLITE_IOERR_DATA || (code & 0xFF) == SQLITE_CORRUPT) Fail(code, "copy");
  throw DiskRefused(say::store::DatabaseNotCopied(file_.string(), file.string(), what));
}

void Database::KeepLog() const {
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
}

void Database::Fail(int code, const char* doing) const {
  const std::string what = handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(code);
  Message failure = say::store::DatabaseFailed(doing, file_.string(), what);
  switch (code & 0xFF) {
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      KeepLog();
      throw DatabaseCorrupt(say::store::DatabaseDamaged(file_.string(), what));
    case SQLITE_FULL:
      throw DiskRefused(say::store::DatabaseFull(std::move(failure)));
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
      throw DiskRefused(say::store::DatabaseReadOnly(std::move(failure)));
    case SQLITE_IOERR:
      if (code == SQLITE_IOERR_DATA) {
        KeepLog();
        if (const std::uint32_t page = LastUnsealedPage(); page != 0)
          throw DatabaseCorrupt(say::store::PageDamaged(page, file_.string()));
        throw DatabaseCorrupt(say::store::LoggedPageDamaged(file_.string()));
      }
      throw DiskRefused(say::store::DatabaseUnreadable(std::move(failure)));
    case SQLITE_BUSY:
      throw DatabaseBusy(say::store::DatabaseBusy(std::move(failure)));
    case SQLITE_CONSTRAINT:
      throw ConstraintBroken(std::move(failure));
    default:
      throw IoError(std::move(failure));
  }
}

Transaction::Transaction(Database& database) : database_(database) {
  database_.Run("BEGIN IMMEDIATE");
}

Transaction::~Transaction() {
  if (!open_) return;
  try {
    database_.Run("ROLLBACK");
  } catch (const IoError&) {  // SQLite rolls back by itself after some errors
  }
}

void Transaction::Commit() {
  if (database_.is_sealed_) database_.CountChange();
  database_.Run("COMMIT");
  open_ = false;
}

}  // namespace plumb
