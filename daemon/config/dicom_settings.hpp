// SPDX-License-Identifier: Apache-2.0
// [dicom] of the configuration: what plumb-dicomd may receive, and from whom; whom plumbd asks for
// the worklist, and who gets its accepted results.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/config/config_section.hpp"

namespace plumb {

/// A sender that is known: both must be right.
struct DicomSender {
  std::string ae_title;
  std::string address;  ///< A number, IPv4 or IPv6.
};

struct DicomSettings {
  bool enabled = false;
  std::string address, ae_title = "PLUMB";
  std::uint16_t port = 0;
  std::vector<DicomSender> senders;
  std::filesystem::path tls_certificate, tls_key, tls_trusted;  ///< All or none.
  std::filesystem::path spool = "/var/lib/plumb-dicom";
  double quota_mb = 2000.0, keep_days = 14.0;
  std::string worklist;          ///< Server to query, "AETITLE@HOST:PORT"; empty: none.
  std::string worklist_station;  ///< AE title of the station whose steps count; empty: all.
  std::string results_to;        ///< Gets accepted results, "AETITLE@HOST:PORT"; empty: none.
};

/// @throws DataError naming the key; also if something is to be received in the clear on an address
///         that is not private, or from anybody.
[[nodiscard]] DicomSettings ReadDicomSettings(Section section);

/// [dicom] of a file; the other tables are not looked at. @throws DataError
[[nodiscard]] DicomSettings ReadDicomSettingsFile(const std::filesystem::path& file);

/// Where received files are as a file states, even if it cannot be used otherwise: the last line
/// that names a spool counts. By default the usual folder. @throws IoError
[[nodiscard]] std::filesystem::path SpoolNamedIn(const std::filesystem::path& file);

/// Of a computer itself or of a network that no router of the internet forwards.
[[nodiscard]] bool IsPrivateAddress(const std::string& address);

}  // namespace plumb
