// SPDX-License-Identifier: Apache-2.0
#include "daemon/state_folder/restore_note.hpp"

#include <chrono>
#include <cstdint>
#include <ctime>
#include <string>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/database/audit_store.hpp"
#include "daemon/database/database.hpp"
#include "daemon/database/stored_values.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {

namespace fs = std::filesystem;

bool IsRestoreInterrupted(const fs::path& state) {
  std::error_code ignored;
  return fs::exists(state / kRestoringOver / kDatabaseFile, ignored);
}

void NoteRestore(const fs::path& state, Database& database) {
  const fs::path note = state / kRestored;
  std::error_code error;
  if (!fs::exists(note, error)) return;
  Message detail;
  try {
    constexpr std::size_t kLongest = 1U << 16U;
    const nlohmann::json about = nlohmann::json::parse(ReadTextFile(note, kLongest));
    const std::time_t time =
        std::chrono::system_clock::to_time_t(FromStored(about.at("time").get<std::int64_t>()));
    detail = say::backup::LogRestored(
        about.at("backup").get<std::string>(), about.at("scans").get<int>(),
        about.at("sha256").get<std::string>(), fmt::format("{:%F %T}", fmt::gmtime(time)));
  } catch (const std::exception& unreadable) {  // that it was restored is known in any case
    detail = say::backup::LogRestoredUnreadable(MessageOf(unreadable));
  }
  Transaction transaction(database);
  AppendAuditEntry(database, kSelf, "backup.restore", "", detail);
  transaction.Commit();
  fs::remove(note, error);  // if that fails, the next start adds the entry once more
}

}  // namespace plumb
