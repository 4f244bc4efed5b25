// SPDX-License-Identifier: Apache-2.0
#include "daemon/state_folder/old_copies.hpp"

#include <algorithm>
#include <functional>
#include <system_error>

#include "daemon/database/database.hpp"
#include "daemon/database/examination.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBeforeRestore = "before-restore-";

/// Calls `change` with the database of a copy. A database without checksums is not converted, since
/// that would make another copy.
void ChangeCopy(const fs::path& copy, const std::function<void(Database&)>& change) {
  const fs::path file = copy / kDatabaseFile;
  try {
    if (!fs::exists(file)) throw IoError(say::store::DatabaseGone(file.string()));
    Database database(file, KindOfDatabase(file) == DatabaseKind::kSealed
                                ? Database::Access::kReadWrite
                                : Database::Access::kUnsealed);
    {
      Transaction transaction(database);
      change(database);
      transaction.Commit();
    }
    (void)database.Checkpoint();  // the log must not keep it either
  } catch (const std::exception& error) {
    throw StoreRefusal(ChangeResult::kConflict,
                       say::store::CopyUnsearchable(copy.string(), MessageOf(error)));
  }
}

}  // namespace

std::vector<fs::path> OldCopies(const fs::path& state) {
  std::vector<fs::path> copies;
  std::error_code error;
  fs::directory_iterator entry(state, error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(kBeforeRestore) || name == kBeforeChecksums)
      copies.push_back(entry->path());
  }
  std::sort(copies.begin(), copies.end());
  return copies;
}

void WipeFromCopy(const fs::path& copy, const std::string& patient_code) {
  std::vector<fs::path> files;
  ChangeCopy(copy, [&](Database& database) {
    const auto patient =
        database.FirstInteger("SELECT id FROM patients WHERE code = ?", patient_code);
    if (!patient) return;
    files = database.All(
        "SELECT id FROM scans WHERE patient_id = ?",
        [&](const Statement& row) { return copy / kScansFolder / ScanId(row.Integer(0)); },
        *patient);
    files.push_back(copy / "imports" / (std::to_string(*patient) + ".json"));
    database.Run("UPDATE patients SET wiping = 1 WHERE id = ?", *patient);
    database.Run("DELETE FROM refs WHERE patient_id = ?", *patient);
    database.Run("DELETE FROM patients WHERE id = ?", *patient);
  });
  for (const fs::path& file : files) {
    std::error_code error;
    fs::remove_all(file, error);
    if (error)
      throw StoreRefusal(
          ChangeResult::kConflict,
          say::store::CopyUnsearchable(copy.string(), Message::Verbatim(error.message())));
  }
}

void RemoveAccountsFromCopy(const fs::path& copy) {
  ChangeCopy(copy, [](Database& database) {
    database.Run("DELETE FROM users");
    if (database.Has("SELECT 1 FROM sqlite_master WHERE name = 'displays'"))
      database.Run("DELETE FROM displays");
    if (database.Has("SELECT 1 FROM sqlite_master WHERE name = 'row_digests'"))
      database.Run("DELETE FROM row_digests WHERE kind IN ('account', 'display')");
  });
}

}  // namespace plumb
