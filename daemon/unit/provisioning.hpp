// SPDX-License-Identifier: Apache-2.0
// Settings of one unit by the factory or a hospital's network administrator, before anybody can log
// in: serial number, name, network, certificate and the display in the room, in one file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "web/model/account.hpp"
#include "web/model/settings.hpp"
#include "web/security/tls_identity.hpp"

namespace plumb {

struct Provisioning {
  std::string serial;     ///< Serial number of the unit; empty if not given, like the others.
  std::string host_name;  ///< One label; the appliance also answers to NAME.local.
  std::string time_zone;  ///< Of this system, such as "Europe/Berlin"; empty: UTC.
  std::string address;    ///< With its prefix, such as "192.168.10.5/24"; empty: DHCP.
  std::string gateway;
  std::vector<std::string> dns, time_servers;
  std::optional<web::TlsIdentity> page;  ///< Certificate and key of the page.
  std::optional<Display> display;        ///< Its name and the hash of its key.
};

/// Reads and checks the whole file; the files that it names are in its folder.
/// @throws DataError naming file, line, what was expected and found.
[[nodiscard]] Provisioning ReadProvisioning(const std::filesystem::path& file);

/// For systemd-networkd: every wired interface, with the address or by DHCP.
[[nodiscard]] std::string NetworkFile(const Provisioning& given);

/// Writes the given settings, each file in one step: `serial`, `host-name`, `time-zone`,
/// `network`, `time-servers` to `unit`, the page's key and the display to `state` with that
/// folder's owner. Settings that are not given are removed from `unit`.
/// @throws IoError
void ApplyProvisioning(const Provisioning& given, const std::filesystem::path& unit,
                       const std::filesystem::path& state);

/// The display that ApplyProvisioning() wrote, if any. @throws DataError
[[nodiscard]] std::optional<Display> ProvisionedDisplay(const std::filesystem::path& state);

}  // namespace plumb
