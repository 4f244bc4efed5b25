// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/dicom_settings.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <array>
#include <optional>
#include <sstream>

#include "algo/base/parse_number.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostSenders = 32;
constexpr std::size_t kMostConfigBytes = std::size_t{1} << 20;

struct NumericAddress {
  int family = AF_UNSPEC;
  std::array<unsigned char, 16> bytes{};
};

std::optional<NumericAddress> NumericOf(const std::string& text) {
  NumericAddress found;
  for (const int family : {AF_INET, AF_INET6}) {
    if (::inet_pton(family, text.c_str(), found.bytes.data()) != 1) continue;
    found.family = family;
    return found;
  }
  return std::nullopt;
}

/// Of a DICOM node, as PS3.5 defines the type AE.
bool IsTitle(std::string_view text) {
  return !text.empty() && text.size() <= 16 && text.front() != ' ' && text.back() != ' ' &&
         std::all_of(text.begin(), text.end(),
                     [](char c) { return c >= ' ' && c <= '~' && c != '\\' && c != '@'; });
}

std::optional<DicomSender> SenderOf(const std::string& text) {
  const std::size_t at = text.find('@');
  if (at == std::string::npos || !IsTitle(std::string_view(text).substr(0, at)) ||
      !NumericOf(text.substr(at + 1)))
    return std::nullopt;
  return DicomSender{.ae_title = text.substr(0, at), .address = text.substr(at + 1)};
}

struct Listen {
  std::string address;
  std::uint16_t port = 0;
};

std::optional<Listen> ListenOf(const std::string& text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string::npos) return std::nullopt;
  std::string address = text.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']'))
    address = address.substr(1, address.size() - 2);
  const auto port = ParseNumber<std::uint16_t>(std::string_view(text).substr(colon + 1));
  if (!NumericOf(address) || !port) return std::nullopt;
  return Listen{.address = address, .port = *port};
}

/// "AETITLE@HOST:PORT"
bool IsNode(const std::string& text) {
  const std::size_t at = text.find('@'), colon = text.rfind(':');
  if (at == std::string::npos || colon == std::string::npos || colon < at + 2) return false;
  const auto port = ParseNumber<std::uint16_t>(std::string_view(text).substr(colon + 1));
  return IsTitle(std::string_view(text).substr(0, at)) && port && *port != 0;
}

std::string HostOf(const std::string& node) {
  const std::size_t at = node.find('@') + 1;
  const std::string host = node.substr(at, node.rfind(':') - at);
  return host.starts_with('[') && host.ends_with(']') ? host.substr(1, host.size() - 2) : host;
}

/// What several keys must fulfil together.
void CheckTogether(const DicomSettings& settings) {
  const int given = static_cast<int>(!settings.tls_certificate.empty()) +
                    static_cast<int>(!settings.tls_key.empty()) +
                    static_cast<int>(!settings.tls_trusted.empty());
  if (given != 0 && given != 3) throw DataError(say::config::DicomTls());
  // The list names patients by their identifiers, and results are theirs.
  for (const auto& [key, node] :
       {std::pair("worklist", &settings.worklist), std::pair("results_to", &settings.results_to)})
    if (given == 0 && !node->empty() && !IsPrivateAddress(HostOf(*node)))
      throw DataError(say::config::NodeInTheClear(key, HostOf(*node)));
  if (!settings.enabled) return;
  if (settings.address.empty()) throw DataError(say::config::DicomListen());
  if (settings.senders.empty()) throw DataError(say::config::DicomSenders());
  if (given == 0 && !IsPrivateAddress(settings.address))
    throw DataError(say::config::DicomInTheClear(settings.address));
}

}  // namespace

bool IsPrivateAddress(const std::string& address) {
  const std::optional<NumericAddress> found = NumericOf(address);
  if (!found) return false;
  const auto& b = found->bytes;
  if (found->family == AF_INET)
    return b[0] == 127 || b[0] == 10 || (b[0] == 172 && b[1] >= 16 && b[1] < 32) ||
           (b[0] == 192 && b[1] == 168);
  in6_addr v6{};
  std::copy(b.begin(), b.end(), v6.s6_addr);
  return IN6_IS_ADDR_LOOPBACK(&v6) || (b[0] & 0xFE) == 0xFC;
}

DicomSettings ReadDicomSettings(Section section) {
  DicomSettings settings;
  section.TakeFlag("enabled", settings.enabled);
  std::string listen;
  section.Take("listen", listen, say::config::ExpectedDicomListen(),
               [](const std::string& text) { return ListenOf(text).has_value(); });
  if (const auto address = ListenOf(listen)) {
    settings.address = address->address;
    settings.port = address->port;
  }
  section.Take("ae_title", settings.ae_title, say::config::ExpectedAeTitle(),
               [](const std::string& text) { return IsTitle(text); });
  std::vector<std::string> senders;
  section.TakeNames("senders", senders, say::config::ExpectedDicomSenders(), kMostSenders,
                    [](const std::string& text) { return SenderOf(text).has_value(); });
  for (const std::string& text : senders) settings.senders.push_back(SenderOf(text).value());
  section.TakePath("tls_certificate", settings.tls_certificate);
  section.TakePath("tls_key", settings.tls_key);
  section.TakePath("tls_trusted", settings.tls_trusted);
  section.TakePath("spool", settings.spool);
  section.TakeNumber("quota_mb", settings.quota_mb, 1, 1e6, say::config::Megabytes());
  section.Take("worklist", settings.worklist, say::config::ExpectedDicomNode(), IsNode);
  section.Take("worklist_station", settings.worklist_station, say::config::ExpectedAeTitle(),
               [](const std::string& text) { return IsTitle(text); });
  section.Take("results_to", settings.results_to, say::config::ExpectedDicomNode(), IsNode);
  section.TakeNumber("keep_days", settings.keep_days, 1, 365, say::config::Days());
  section.RejectUnknownKeys();
  CheckTogether(settings);
  return settings;
}

DicomSettings ReadDicomSettingsFile(const std::filesystem::path& file) {
  const std::string name = file.string();
  const toml::table root = ParseToml(ReadTextFile(file, kMostConfigBytes), name);
  return ReadDicomSettings(Section(root, "dicom", name));
}

std::filesystem::path SpoolNamedIn(const std::filesystem::path& file) {
  std::filesystem::path spool = DicomSettings{}.spool;
  std::istringstream lines(ReadTextFile(file, kMostConfigBytes));
  try {
    return ReadDicomSettingsFile(file).spool;
  } catch (const DataError&) {  // it may not be valid TOML
    for (std::string line; std::getline(lines, line);) {
      const std::size_t key = line.find("spool"), begin = line.find_first_of("\"'", key);
      if (key > line.find('#') || begin == std::string::npos) continue;
      const std::size_t end = line.find(line[begin], begin + 1);
      const std::string text = line.substr(begin + 1, end - begin - 1);
      if (text.starts_with('/') && end != std::string::npos) spool = text;
    }
  }
  return spool;
}

}  // namespace plumb
