// SPDX-License-Identifier: Apache-2.0
// The parts of SQLite that the store needs: statements, transactions, and errors that state what to
// do.
#pragma once

#include <chrono>
#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "daemon/database/database_errors.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace plumb {

/// In the state folder.
inline constexpr const char* kDatabaseFile = "plumb.db";
/// In the state folder; keeps the database as it was before its pages had checksums.
inline constexpr const char* kBeforeChecksums = "before-checksums";

class Database;

/// One statement, to be bound and stepped; returned to the database's cache on destruction.
/// Parameters and columns count from 0.
class Statement {
 public:
  ~Statement();
  Statement(Statement&& other) noexcept;
  Statement& operator=(Statement&&) = delete;

  Statement& Bind(std::int64_t value);
  Statement& Bind(double value);
  Statement& Bind(std::string_view value);
  Statement& BindNull();
  template <std::integral T>
  Statement& Bind(T value) {
    return Bind(static_cast<std::int64_t>(value));
  }
  template <typename T>
  Statement& Bind(const std::optional<T>& value) {
    return value ? Bind(*value) : BindNull();
  }

  /// True if there is a (further) row. @throws IoError and its kinds
  bool Step();
  /// Steps to the end.
  void Run();

  [[nodiscard]] bool IsNull(int column) const;
  [[nodiscard]] std::int64_t Integer(int column) const;
  [[nodiscard]] double Real(int column) const;
  [[nodiscard]] std::string Text(int column) const;

 private:
  friend class Database;
  Statement(Database& database, sqlite3_stmt*& idle, sqlite3_stmt* statement)
      : database_(&database), idle_(&idle), statement_(statement) {}
  Database* database_;
  sqlite3_stmt** idle_;  ///< Its place in the database's cache.
  sqlite3_stmt* statement_;
  int next_ = 1;
};

/// One connection, used by one thread at a time. Write-ahead log, foreign keys on; commits are on
/// the disk when they return. The file belongs to one process at a time: data shared by connections
/// is in its memory and not in a mapped file, whose disk may become read-only.
///
/// Each page carries a checksum, compared when it is read from the file or from the log of writes:
/// a page that a disk has changed, or that is of an earlier time (page_seals.hpp), is
/// DatabaseCorrupt. What was read or written stays in the memory of the process (kept_pages.hpp),
/// so that rows are read without waiting for the disk. Before a connection is opened that may write
/// or that is the only one, the log of writes is examined and compared with the database and its
/// mark (examination.hpp). A database of 0.2.0 gets its checksums the first time that it is opened
/// for writing: the original is copied to before-checksums/; a new file is written, checked, and
/// then replaces the original. After an interruption one of the two is in place, and the next
/// attempt starts over.
class Database {
 public:
  enum class Access {
    kReadWrite,
    kReadOnly,  ///< In addition to a connection that writes.
    kFromDisk,  ///< As kReadOnly, but reads everything from the disk: for checks.
    kFrozen,    ///< On a disk that cannot be written at all.
    kUnsealed,  ///< Writes a database of 0.2.0 without checksums; for its conversion.
  };
  /// @param busy_wait  Time to wait for another connection that holds the file, before
  ///         DatabaseBusy.
  /// @throws IoError and its kinds.
  Database(const std::filesystem::path& file, Access access,
           std::chrono::milliseconds busy_wait = std::chrono::seconds(5));
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Runs one or more statements without parameters.
  void Execute(const std::string& sql);
  /// With these values for its parameters. Prepared once and kept for the next call: the text must
  /// not contain data, because the cache only grows.
  template <typename... Values>
  [[nodiscard]] Statement Prepare(std::string_view sql, const Values&... values) {
    Statement statement = Take(sql);
    (statement.Bind(values), ...);
    return statement;
  }
  /// Prepares the statement and runs it to its end.
  template <typename... Values>
  void Run(std::string_view sql, const Values&... values) {
    Prepare(sql, values...).Run();
  }
  /// Whether the query has a row.
  template <typename... Values>
  [[nodiscard]] bool Has(std::string_view sql, const Values&... values) {
    return Prepare(sql, values...).Step();
  }
  /// What `read` makes of the first row, a `const Statement&`.
  template <typename Read, typename... Values>
  [[nodiscard]] auto First(std::string_view sql, const Read& read, const Values&... values) {
    Statement row = Prepare(sql, values...);
    using Value = std::invoke_result_t<const Read&, const Statement&>;
    return row.Step() ? std::optional<Value>(read(row)) : std::nullopt;
  }
  /// What `read` makes of every row.
  template <typename Read, typename... Values>
  [[nodiscard]] auto All(std::string_view sql, const Read& read, const Values&... values) {
    Statement row = Prepare(sql, values...);
    std::vector<std::invoke_result_t<const Read&, const Statement&>> all;
    while (row.Step()) all.push_back(read(row));
    return all;
  }
  /// The first column of the first row.
  template <typename... Values>
  [[nodiscard]] std::optional<std::string> FirstText(std::string_view sql,
                                                     const Values&... values) {
    return First(
        sql, [](const Statement& row) { return row.Text(0); }, values...);
  }
  template <typename... Values>
  [[nodiscard]] std::optional<std::int64_t> FirstInteger(std::string_view sql,
                                                         const Values&... values) {
    return First(
        sql, [](const Statement& row) { return row.Integer(0); }, values...);
  }
  [[nodiscard]] std::int64_t last_id() const;
  [[nodiscard]] int num_changed() const;
  /// Checks everything within a time limit. False: not everything could be checked in that time.
  /// @throws DatabaseCorrupt naming SQLite's finding.
  bool CheckIntegrity(std::chrono::milliseconds limit = std::chrono::hours(1));
  /// A copy as of one moment; others may write meanwhile. The file must not exist.
  /// @throws IoError and its kinds
  void CopyTo(const std::filesystem::path& file);
  /// Moves the log of writes into the database and empties it. False: another connection is
  /// reading, or the disk refuses; everything stays in the log then.
  bool Checkpoint();
  /// Of `keyed_digest(...)` in its statements: HMAC-SHA256 of types and values, in hexadecimal.
  void UseKey(const std::string& key);
  /// A copy whose pages carry checksums. The file must not exist. @throws IoError and its kinds
  void WriteSealed(const std::filesystem::path& file);

 private:
  friend class Statement;
  friend class Transaction;
  void PrepareToWrite();
  [[nodiscard]] std::int64_t Changes();
  void CountChange();
  void KeepLog() const;  ///< Of a damaged database: closing it leaves the log as it is.
  [[nodiscard]] Statement Take(std::string_view sql);
  [[noreturn]] void Fail(int code, const char* doing) const;

  std::filesystem::path file_;
  std::chrono::milliseconds busy_wait_;
  bool is_sealed_;
  sqlite3* handle_ = nullptr;
  std::map<std::string, sqlite3_stmt*, std::less<>> idle_;  ///< By text; null while in use.
};

/// Rolled back unless Commit() was called. Takes the write lock immediately.
class Transaction {
 public:
  explicit Transaction(Database& database);
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;
  void Commit();

 private:
  Database& database_;
  bool open_ = true;
};

}  // namespace plumb
