// What was installed last, remembered over the restart: whether the machine has kept it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace plumb {

struct LastUpdate {
  std::string version;    ///< That was installed.
  std::string from_slot;  ///< The system that ran then.
  std::string boot;       ///< The machine's start in which that was.
  bool operator==(const LastUpdate&) const = default;
};

/// Nothing where there is none, or none that can be read.
[[nodiscard]] std::optional<LastUpdate> ReadLastUpdate(const std::filesystem::path& folder);
/// Durably. @throws IoError
void WriteLastUpdate(const std::filesystem::path& folder, const LastUpdate& update);
void RemoveLastUpdate(const std::filesystem::path& folder);

/// Empty, or a sentence: the machine was restarted since, and what runs is the system that was to
/// be replaced. Nothing is said where a slot or a start is not known.
[[nodiscard]] std::string WhyRolledBack(const LastUpdate& update, const std::string& slot,
                                        const std::string& boot, const std::string& version);

}  // namespace plumb
