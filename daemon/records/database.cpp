#include "daemon/records/database.hpp"

#include <sqlite3.h>

#include <utility>

#include <fmt/format.h>

namespace plumb {
namespace {

/// The file's name as a URI, with the options that SQLite needs for such a disk.
std::string UriOf(const std::filesystem::path& file, Database::Access access) {
  std::string uri = "file:";
  for (const char c : file.string()) {
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      uri += c;
    }
  }
  // A database that was closed cleanly has no write-ahead log, and none can be created.
  std::error_code error;
  if (access == Database::Access::kFrozen &&
      !std::filesystem::exists(file.string() + "-wal", error))
    uri += "?immutable=1";
  return uri;
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
    : file_(file) {
  const int flags = access == Access::kReadWrite ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE
                                                 : SQLITE_OPEN_READONLY;
  // no locks; locks for this process only
  const char* const system = access == Access::kFrozen ? "unix-none" : "unix-excl";
  try {
    if (const int code = sqlite3_open_v2(UriOf(file, access).c_str(), &handle_,
                                         flags | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI, system);
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
    if (access == Access::kReadWrite)
      Execute("PRAGMA journal_mode = WAL; PRAGMA journal_size_limit = 4194304;");
  } catch (...) {
    sqlite3_close(handle_);
    throw;
  }
}

Database::~Database() {
  for (const auto& [sql, statement] : idle_) sqlite3_finalize(statement);
  sqlite3_close(handle_);
}

void Database::Execute(const std::string& sql) {
  if (const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr);
      code != SQLITE_OK)
    Fail(code, "set up");
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
    throw DatabaseCorrupt(
        fmt::format("the database {} is damaged ({}): put a backup in its place, or move it and "
                    "the folder scans away to "
                    "start over",
                    file_.string(), found));
  }
  return !is_cut_short;
}

void Database::CopyTo(const std::filesystem::path& file) {
  sqlite3* copy = nullptr;
  int code =
      sqlite3_open_v2(file.c_str(), &copy,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
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
  throw DiskRefused(
      fmt::format("cannot copy the database {} to {}: {}; the disk may be full or "
                  "failing",
                  file_.string(), file.string(), what));
}

void Database::Fail(int code, const char* doing) const {
  const std::string what = handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(code);
  const std::string message =
      fmt::format("cannot {} the database {}: {}", doing, file_.string(), what);
  switch (code & 0xFF) {
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      throw DatabaseCorrupt(
          fmt::format("the database {} is damaged ({}): put a backup in its place, or move it and "
                      "the folder scans away to start over",
                      file_.string(), what));
    case SQLITE_FULL:
      throw DiskRefused(message + "; free space on that disk");
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
      throw DiskRefused(message + "; make the folder writable for this user");
    case SQLITE_IOERR:
      throw DiskRefused(message + "; the disk may be full or failing");
    case SQLITE_BUSY:
      throw DatabaseBusy(message + "; does another plumbd use this folder?");
    case SQLITE_CONSTRAINT:
      throw ConstraintBroken(message);
    default:
      throw IoError(message);
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
  database_.Run("COMMIT");
  open_ = false;
}

}  // namespace plumb
