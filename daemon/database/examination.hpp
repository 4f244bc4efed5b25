// SPDX-License-Identifier: Apache-2.0
// Examines a database and its log of writes before SQLite opens them: SQLite would silently drop
// everything after the first wrong sum in the log, and overwrite it.
#pragma once

#include <filesystem>

namespace plumb {

enum class DatabaseKind {
  kNew,     ///< There is none.
  kSealed,  ///< With a checksum in each page.
  kPlain,   ///< Of 0.2.0 or older, or no database at all, which SQLite refuses.
};

/// Reads the database's first page only. @throws DatabaseCorrupt if it is not as it was written.
[[nodiscard]] DatabaseKind KindOfDatabase(const std::filesystem::path& file);

/// Also reads the log of writes and the mark. No connection may be writing. Changes nothing.
/// @throws DatabaseCorrupt if the log is damaged or belongs to another database, or if a confirmed
/// change is neither in the database nor in the log.
[[nodiscard]] DatabaseKind ExamineDatabase(const std::filesystem::path& file);

}  // namespace plumb
