// SPDX-License-Identifier: Apache-2.0
#include "daemon/imports/imported_room.hpp"

#include <unistd.h>

#include <array>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/database/stored_values.hpp"
#include "drivers/files/file_io.hpp"
#include "words/room.hpp"

namespace plumb {
namespace {

using RoomJson = nlohmann::ordered_json;

constexpr std::size_t kMostImportBytes = std::size_t{256} << 20;
constexpr std::size_t kLongestUnitName = 64;

/// @throws DataError or an error of JSON if it is not as it was signed
ImportedRoom RoomIn(const RoomJson& json) {
  ImportedRoom found{.unit = json.at("unit").get<std::string>().substr(0, kLongestUnitName),
                     .version = json.at("version").get<int>(),
                     .room = SignedRoomIn(json.at("json").get<std::string>())};
  if (found.room->digest != json.at("digest").get<std::string>())
    throw DataError(say::room::ElsewhereNotAsSigned(found.unit));
  found.room->version = found.version;
  found.room->signed_at = FromStored(json.at("signed_at").get<std::int64_t>());
  found.room->signed_by = json.at("signed_by").get<std::string>();
  return found;
}

}  // namespace

std::filesystem::path ImportedFile(const std::filesystem::path& state, std::int64_t patient) {
  return state / "imports" / fmt::format("{}.json", patient);
}

RoomJson OwnRoomJson(Database& database) {
  Statement newest = database.Prepare(
      "SELECT version, signed_at, signed_by, digest, json FROM room_calibrations ORDER BY version "
      "DESC LIMIT 1");
  if (!newest.Step()) return nullptr;
  std::array<char, 256> name{};
  (void)::gethostname(name.data(), name.size() - 1);
  return {{"unit", std::string(name.data())}, {"version", newest.Integer(0)},
          {"signed_at", newest.Integer(1)},   {"signed_by", newest.Text(2)},
          {"digest", newest.Text(3)},         {"json", newest.Text(4)}};
}

std::optional<ImportedRoom> RoomOfImport(const std::filesystem::path& state,
                                         const std::string& patient_id,
                                         const std::string& scan_id) {
  const std::optional<std::int64_t> patient = ParseId(patient_id), scan = ParseId(scan_id);
  std::error_code error;
  if (!patient || !scan || !std::filesystem::exists(ImportedFile(state, *patient), error))
    return std::nullopt;
  try {
    const auto record =
        ParseBoundedJson<RoomJson>(ReadTextFile(ImportedFile(state, *patient), kMostImportBytes));
    // What an older version imported does not say which scans came with it.
    if (!record.contains("rooms_here")) return std::nullopt;
    const auto found = record["rooms_here"].find(std::to_string(*scan));
    if (found == record["rooms_here"].end()) return std::nullopt;
    if (!found->is_null()) return RoomIn(*found);
    return ImportedRoom{
        .unit = {}, .version = 0, .room = {}, .why_not = say::room::ElsewhereNotCalibrated()};
  } catch (const std::exception& wrong) {
    return ImportedRoom{.unit = {}, .version = 0, .room = {}, .why_not = MessageOf(wrong)};
  }
}

}  // namespace plumb
