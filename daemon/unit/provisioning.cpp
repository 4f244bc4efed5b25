// SPDX-License-Identifier: Apache-2.0
#include "daemon/unit/provisioning.hpp"

#include <arpa/inet.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/base/errors.hpp"
#include "daemon/config/config_section.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/unit/page_identity.hpp"
#include "drivers/files/file_io.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/security/secrets.hpp"
#include "words/upkeep.hpp"
#include "words/web.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxProvisionedBytes = 64 << 10;
constexpr std::size_t kMaxServers = 8;
constexpr std::size_t kKeyDigits = 64;  // 32 random bytes; no longer, because it becomes a cookie
constexpr const char* kDisplayFile = "provisioned-display";  // the hash of its key, and its name

bool IsWord(std::string_view text, std::string_view also, std::size_t longest) {
  return !text.empty() && text.size() <= longest &&
         std::all_of(text.begin(), text.end(), [&](unsigned char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                  also.find(static_cast<char>(c)) != std::string_view::npos;
         });
}

bool IsHex(std::string_view text, std::size_t digits) {
  return text.size() == digits && std::all_of(text.begin(), text.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

/// The name of a file, with nothing outside the folder of the file that names it.
bool IsPlainFile(const std::string& name) {
  return IsWord(name, "._-", 128) && name.front() != '.';
}

bool IsDisplayName(const std::string& name) {
  return IsWord(name, " ._-", kMaxName) && name.front() != ' ' && name.back() != ' ';
}

/// 32 or 128 bits, or nothing.
std::optional<int> BitsOfAddress(const std::string& text) {
  std::array<unsigned char, 16> bytes{};
  if (::inet_pton(AF_INET, text.c_str(), bytes.data()) == 1) return 32;
  if (::inet_pton(AF_INET6, text.c_str(), bytes.data()) == 1) return 128;
  return std::nullopt;
}

bool IsAddress(const std::string& text) { return BitsOfAddress(text).has_value(); }

bool IsAddressWithPrefix(const std::string& text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string::npos) return false;
  const std::optional<int> bits = BitsOfAddress(text.substr(0, slash));
  int prefix = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + slash + 1, end, prefix);
  return bits && error == std::errc() && stop == end && prefix >= 1 && prefix <= *bits;
}

bool IsHostName(const std::string& text) {
  return IsWord(text, "-", 63) && text.front() != '-' && text.back() != '-';
}

/// A file of the system's time zones, and nothing outside their folder.
bool IsTimeZone(const std::string& name) {
  if (!IsWord(name, "/_+-", 64) || name.front() == '/') return false;
  std::ifstream file(fs::path("/usr/share/zoneinfo") / name, std::ios::binary);
  std::array<char, 4> kind{};
  return file.read(kind.data(), kind.size()) && std::string_view(kind.data(), 4) == "TZif";
}

bool IsServer(const std::string& text) { return IsAddress(text) || IsWord(text, ".-", 253); }

void TakeServers(Section& section, const char* key, std::vector<std::string>& servers,
                 bool (*is_valid)(const std::string&), const Message& expected,
                 const std::string& name) {
  section.TakeNames(key, servers, expected, kMaxServers);
  for (const std::string& server : servers) {
    if (!is_valid(server))
      throw DataError(say::upkeep::NotAServer(name, key, expected, server.substr(0, 64)));
  }
}

void ReadNetwork(Section section, const std::string& name, Provisioning& given) {
  const auto text = [](auto is_valid) {
    return [is_valid](const std::string& value) { return is_valid(value); };
  };
  section.Take("address", given.address, say::config::ExpectedPrefixedAddress(),
               text(IsAddressWithPrefix));
  section.Take("gateway", given.gateway, say::config::ExpectedAddress(), text(IsAddress));
  TakeServers(section, "dns", given.dns, IsAddress, say::config::ExpectedAddresses(), name);
  TakeServers(section, "time_servers", given.time_servers, IsServer, say::config::ExpectedServers(),
              name);
  section.RejectUnknownKeys();
  if (given.address.empty() && (!given.gateway.empty() || !given.dns.empty()))
    throw DataError(say::upkeep::GatewayWithoutAddress(name));
}

void ReadPage(Section section, const fs::path& file, Provisioning& given) {
  std::string certificate, key;
  section.Take("certificate", certificate, say::config::ExpectedPemFile(), IsPlainFile);
  section.Take("key", key, say::config::ExpectedPemFile(), IsPlainFile);
  section.RejectUnknownKeys();
  if (certificate.empty() != key.empty())
    throw DataError(say::upkeep::CertificateWithoutKey(file.string()));
  if (certificate.empty()) return;
  const fs::path folder = file.parent_path();
  given.page = web::CheckedTlsIdentity(ReadTextFile(folder / certificate, kMaxProvisionedBytes),
                                       ReadTextFile(folder / key, kMaxProvisionedBytes),
                                       say::web::FileNamed((folder / certificate).string()));
}

/// The messages say how long a wrong key is, but show nothing of it.
std::string CheckedDisplayKey(const fs::path& file) {
  std::string key = ReadTextFile(file, kMaxProvisionedBytes);
  while (!key.empty() && (key.back() == '\n' || key.back() == '\r')) key.pop_back();
  if (IsHex(key, kKeyDigits)) return key;
  throw DataError(key.size() == kKeyDigits
                      ? say::upkeep::WrongCharacter(file.string(), kKeyDigits)
                      : say::upkeep::WrongDisplayKey(file.string(), kKeyDigits,
                                                     static_cast<std::int64_t>(key.size())));
}

void ReadDisplay(Section section, const toml::table& root, const fs::path& file,
                 Provisioning& given) {
  std::string name, key_file;
  section.Take("name", name, say::config::ExpectedDisplayName(), IsDisplayName);
  section.Take("key_file", key_file, say::config::ExpectedFileBeside(), IsPlainFile);
  section.RejectUnknownKeys();
  if (name.empty() != key_file.empty())
    throw DataError(say::upkeep::DisplayNameWithoutKey(file.string()));
  if (name.empty()) return;
  try {
    const std::string key = CheckedDisplayKey(file.parent_path() / key_file);
    given.display = Display{
        .id = {},
        .name = name,
        .token_hash = web::StoredHashOf(key),
        .paired_at = {},
        .paired_by = {},
    };
  } catch (const DataError& error) {
    throw DataError(say::upkeep::DisplayKey(
        file.string(), root["display"]["key_file"].node()->source().begin.line, error.message()));
  }
}

void Put(const fs::path& file, const std::string& text) {
  if (text.empty()) {
    if (::unlink(file.c_str()) != 0 && errno != ENOENT)
      throw IoError(DescribeWriteError(file, errno));
    return;
  }
  WriteFileAtomically(file, [&](const fs::path& hidden) { WriteWholeFile(hidden, text); });
}

}  // namespace

Provisioning ReadProvisioning(const fs::path& file) {
  const std::string name = file.string();
  const toml::table root = ParseToml(ReadTextFile(file, kMaxProvisionedBytes), name);
  RejectUnknownTables(root, name, {"unit", "network", "page", "display"});
  Provisioning given;
  Section unit(root, "unit", name);
  unit.Take("serial", given.serial, say::config::ExpectedUnitSerial(),
            [](const std::string& value) { return IsWord(value, "._-", 32); });
  unit.Take("host_name", given.host_name, say::config::ExpectedUnitName(), IsHostName);
  unit.Take("time_zone", given.time_zone, say::config::ExpectedTimeZone(), IsTimeZone);
  unit.RejectUnknownKeys();
  ReadNetwork(Section(root, "network", name), name, given);
  ReadPage(Section(root, "page", name), file, given);
  ReadDisplay(Section(root, "display", name), root, file, given);
  return given;
}

std::string NetworkFile(const Provisioning& given) {
  std::string text = "[Match]\nName=en* eth*\n[Network]\nMulticastDNS=yes\n";
  if (given.address.empty()) return text + "DHCP=yes\n";
  text += fmt::format("Address={}\n", given.address);
  if (!given.gateway.empty()) text += fmt::format("Gateway={}\n", given.gateway);
  for (const std::string& server : given.dns) text += fmt::format("DNS={}\n", server);
  return text;
}

void ApplyProvisioning(const Provisioning& given, const fs::path& unit, const fs::path& state) {
  std::error_code ignored;
  fs::create_directories(unit, ignored);
  const auto line = [](const std::string& text) { return text.empty() ? "" : text + "\n"; };
  Put(unit / "serial", line(given.serial));
  Put(unit / "host-name", line(given.host_name));
  Put(unit / "time-zone", line(given.time_zone));
  Put(unit / "network", NetworkFile(given));
  Put(unit / "time-servers",
      given.time_servers.empty()
          ? ""
          : fmt::format("[Time]\nNTP={}\n", fmt::join(given.time_servers, " ")));
  if (given.page) KeepPageIdentity(state, *given.page);
  if (given.display)
    KeepSecret(state / kDisplayFile,
               fmt::format("{} {}\n", given.display->token_hash, given.display->name));
}

std::optional<Display> ProvisionedDisplay(const fs::path& state) {
  const fs::path file = state / kDisplayFile;
  std::error_code ignored;
  if (fs::symlink_status(file, ignored).type() == fs::file_type::not_found) return std::nullopt;
  std::string text = ReadTextFile(file, kMaxProvisionedBytes);
  if (text.ends_with('\n')) text.pop_back();
  const std::size_t space = std::min(text.find(' '), text.size());
  Display display{.id = {},
                  .name = text.substr(std::min(space + 1, text.size())),
                  .token_hash = text.substr(0, space),
                  .paired_at = {},
                  .paired_by = {}};
  if (!IsHex(display.token_hash, kKeyDigits) || !IsDisplayName(display.name))
    throw DataError(say::upkeep::StoredDisplay(file.string(), kKeyDigits,
                                               static_cast<std::int64_t>(text.size())));
  return display;
}

}  // namespace plumb
