// SPDX-License-Identifier: Apache-2.0
// The room of another unit, in which the scans of an imported patient were made.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "daemon/database/database.hpp"
#include "daemon/records/room_calibration.hpp"

namespace plumb {

/// imports/NUMBER.json below the state folder: what came with a patient.
[[nodiscard]] std::filesystem::path ImportedFile(const std::filesystem::path& state,
                                                 std::int64_t patient);

/// The newest signed calibration of this unit as an export carries it: {"unit", "version",
/// "signed_at", "signed_by", "digest", "json"}; null if none was ever signed.
[[nodiscard]] nlohmann::ordered_json OwnRoomJson(Database& database);

struct ImportedRoom {
  std::string unit;                ///< Name of the machine.
  int version = 0;                 ///< Of its calibration.
  std::optional<SignedRoom> room;  ///< Not set: `why_not` says why.
  Message why_not = {};
};

/// Nothing for a scan that was made by this unit. Reads a file: not on the loop.
[[nodiscard]] std::optional<ImportedRoom> RoomOfImport(const std::filesystem::path& state,
                                                       const std::string& patient_id,
                                                       const std::string& scan_id);

}  // namespace plumb
