// SPDX-License-Identifier: Apache-2.0
// The last installed update, remembered across the restart, to detect whether the machine has kept
// it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "algo/base/message.hpp"

namespace plumb {

struct LastUpdate {
  std::string version;    ///< Installed version.
  std::string from_slot;  ///< The system that ran then.
  std::string boot;       ///< The start of the machine in which it was installed.
  bool operator==(const LastUpdate&) const = default;
};

/// Nothing if there is none, or it cannot be read.
[[nodiscard]] std::optional<LastUpdate> ReadLastUpdate(const std::filesystem::path& folder);
/// Durably. @throws IoError
void WriteLastUpdate(const std::filesystem::path& folder, const LastUpdate& update);
/// Durably. That there is none is not an error. @throws IoError
void RemoveLastUpdate(const std::filesystem::path& folder);

/// Empty, or that it was: the machine was restarted since, and the running system is the one that
/// was to be replaced. Empty if a slot or a start is unknown.
[[nodiscard]] Message WhyRolledBack(const LastUpdate& update, const std::string& slot,
                                    const std::string& boot, const std::string& version);

}  // namespace plumb
