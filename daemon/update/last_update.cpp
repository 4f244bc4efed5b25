// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/last_update.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/file_io.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;
constexpr const char* kFile = "last-update.json";
constexpr std::size_t kMaxBytes = 4096;

}  // namespace

std::optional<LastUpdate> ReadLastUpdate(const std::filesystem::path& folder) {
  try {
    const Json json = ParseBoundedJsonOrNothing(ReadTextFile(folder / kFile, kMaxBytes));
    if (!json.is_object()) return std::nullopt;
    return LastUpdate{.version = json.at("version").get<std::string>(),
                      .from_slot = json.at("from_slot").get<std::string>(),
                      .boot = json.at("boot").get<std::string>()};
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

void WriteLastUpdate(const std::filesystem::path& folder, const LastUpdate& update) {
  PlaceFile(
      folder, kFile,
      Json{{"version", update.version}, {"from_slot", update.from_slot}, {"boot", update.boot}}
          .dump(-1, ' ', false, Json::error_handler_t::replace));
}

void RemoveLastUpdate(const std::filesystem::path& folder) {
  std::error_code error;
  const bool is_removed = std::filesystem::remove(folder / kFile, error);
  if (error) throw IoError(say::update::NotRemoved(kFile, error.message()));
  if (is_removed) SyncToDisk(folder);
}

Message WhyRolledBack(const LastUpdate& update, const std::string& slot, const std::string& boot,
                      const std::string& version) {
  if (slot.empty() || boot.empty() || update.boot.empty()) return {};
  if (update.boot == boot || update.from_slot != slot) return {};
  return say::update::RolledBack(update.version, version);
}

}  // namespace plumb
