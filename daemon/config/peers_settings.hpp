// SPDX-License-Identifier: Apache-2.0
// Section [peers] of the configuration: the other units of the clinic.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/config/config_section.hpp"

namespace plumb {

/// Without a secret no unit is asked and none is answered.
struct PeersSettings {
  std::vector<std::string> units;     ///< https://HOST:PORT of each other unit.
  std::filesystem::path secret_file;  ///< The same secret in all units.
  std::filesystem::path trusted;      ///< Certificates, PEM; empty: those of the system.

  bool operator==(const PeersSettings&) const = default;
};

/// @throws DataError naming the key; also for keys that do not fit together.
[[nodiscard]] PeersSettings ReadPeersSettings(Section section);

}  // namespace plumb
