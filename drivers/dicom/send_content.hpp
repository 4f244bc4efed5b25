// SPDX-License-Identifier: Apache-2.0
// What plumb-dicom-sender is asked to send, and to whom.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// A node of a DICOM network.
struct DicomPeer {
  std::string ae_title, host;
  std::uint16_t port = 0;
};

/// PEM files; all empty: no TLS.
struct DicomTlsFiles {
  std::string certificate, key, trusted;
  [[nodiscard]] bool empty() const { return certificate.empty() && key.empty() && trusted.empty(); }
  [[nodiscard]] bool complete() const {
    return !certificate.empty() && !key.empty() && !trusted.empty();
  }
};

struct DicomSendRequest {
  DicomPeer peer = {};
  std::string own_ae_title = "PLUMB";
  DicomTlsFiles tls = {};
  std::vector<std::string> files = {};
};

/// All files of a request together.
inline constexpr std::size_t kMostSentBytes = std::size_t{256} << 20;
inline constexpr std::size_t kMostSentFiles = 100;

/// 1 to 16 printable characters of ASCII, no backslash, not only blanks.
[[nodiscard]] bool IsAeTitle(std::string_view text);

/// "AETITLE@host:port", an IPv6 address in brackets. Nothing for any other text.
[[nodiscard]] std::optional<DicomPeer> ParseDicomPeer(std::string_view text);

/// One line of JSON; an argument of the program.
[[nodiscard]] std::string SendRequestText(const DicomSendRequest& request);
/// @throws DataError for what is no such text.
[[nodiscard]] DicomSendRequest ParseSendRequest(std::string_view text);

}  // namespace plumb
