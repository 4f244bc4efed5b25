// What a factory or a hospital's network gives to one unit before anybody can log in: its serial
// number, name, network and certificate, in one file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "web/security/tls_identity.hpp"

namespace plumb {

struct Provisioning {
  std::string serial;     ///< Of the unit; empty: not given, as with each of the others.
  std::string host_name;  ///< One label; the appliance answers to NAME.local too.
  std::string address;    ///< With its prefix, "192.168.10.5/24"; empty: DHCP.
  std::string gateway;
  std::vector<std::string> dns, time_servers;
  std::optional<web::TlsIdentity> page;  ///< Certificate and key of the page.
};

/// Reads and checks all of a file; the PEM files that it names lie in its folder.
/// @throws DataError naming file, line, what was expected and found.
[[nodiscard]] Provisioning ReadProvisioning(const std::filesystem::path& file);

/// For systemd-networkd: every wired interface, with the address or by DHCP.
[[nodiscard]] std::string NetworkFile(const Provisioning& given);

/// Writes what was given, each file in one step: `serial`, `host-name`, `network`, `time-servers`
/// to `unit`, the page's key to `state`, for whom that folder belongs to. What is not given goes
/// from `unit`. @throws IoError
void ApplyProvisioning(const Provisioning& given, const std::filesystem::path& unit,
                       const std::filesystem::path& state);

}  // namespace plumb
