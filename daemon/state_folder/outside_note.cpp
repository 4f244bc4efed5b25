// SPDX-License-Identifier: Apache-2.0
#include "daemon/state_folder/outside_note.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "daemon/state_folder/scan_numbers.hpp"
#include "drivers/files/file_io.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostHeads = 400;  // more than one a day for a year

bool IsInLog(Database& database, const AuditHead& head) {
  return database.Has("SELECT 1 FROM audit WHERE number = ? AND chain = ?", head.number,
                      head.chain);
}

}  // namespace

std::optional<OutsideNote> ReadOutsideNote(const fs::path& folder) {
  constexpr std::size_t kLongest = std::size_t{1} << 20U;
  const fs::path file = folder / kOutsideNote;
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  const Json json = ParseBoundedJsonOrNothing<Json>(ReadTextFile(file, kLongest));
  OutsideNote note;
  try {
    note.last_scan = json.at("last_scan").get<std::int64_t>();
    for (const Json& head : json.at("audit_log"))
      note.heads.push_back({.number = head.at("entry").get<std::int64_t>(),
                            .chain = head.at("chain").get<std::string>()});
  } catch (const Json::exception&) {
    throw DataError(say::store::OutsideNoteUnreadable(file.string()));
  }
  return note;
}

void WriteOutsideNote(const fs::path& folder, const OutsideNote& note) {
  Json heads = Json::array();
  for (const AuditHead& head : note.heads)
    heads.push_back({{"entry", head.number}, {"chain", head.chain}});
  const Json json = {{"last_scan", note.last_scan}, {"audit_log", heads}};
  PlaceFile(folder, kOutsideNote, json.dump(1) + "\n");
}

std::int64_t LostEntries(Database& database, const OutsideNote& note) {
  std::int64_t common = 0;
  for (auto head = note.heads.rbegin(); head != note.heads.rend() && common == 0; ++head)
    common = IsInLog(database, *head) ? head->number : 0;
  if (note.heads.empty() || common == note.heads.back().number) return 0;
  if (database.Has("SELECT 1 FROM audit WHERE number > ? AND action IN ('backup.restore', "
                   "'system.factory_reset')",
                   common))
    return 0;
  return note.heads.back().number - common;
}

OutsideNote Renewed(Database& database, OutsideNote note) {
  note.last_scan = std::max(note.last_scan, LastScanNumber(database));
  std::erase_if(note.heads, [&](const AuditHead& head) { return !IsInLog(database, head); });
  const auto newest = database.First(
      "SELECT number, chain FROM audit WHERE chain <> '' ORDER BY number DESC LIMIT 1",
      [](const Statement& row) {
        return AuditHead{.number = row.Integer(0), .chain = row.Text(1)};
      });
  if (newest && (note.heads.empty() || note.heads.back().number < newest->number))
    note.heads.push_back(*newest);
  if (note.heads.size() > kMostHeads)
    note.heads.erase(note.heads.begin(),
                     note.heads.end() - static_cast<std::ptrdiff_t>(kMostHeads));
  return note;
}

}  // namespace plumb
