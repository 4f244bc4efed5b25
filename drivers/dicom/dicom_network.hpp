// SPDX-License-Identifier: Apache-2.0
// What the programs share that speak DICOM over a network, with DCMTK.
#pragma once

#include <memory>

#include "drivers/dicom/send_content.hpp"

class DcmTransportLayer;

namespace plumb {

/// Seconds that the other side may let pass.
inline constexpr int kConnectPatience_s = 10;
inline constexpr int kAssociatePatience_s = 10;
inline constexpr int kAnswerPatience_s = 25;

/// Quiet, no look-ups of names, short time limits, and a data dictionary.
/// @throws IoError if there is none.
void PrepareDicomNetwork();

enum class DicomRole { kSends, kReceives };

/// TLS by the profile of BCP 195; the other side must show a certificate that one of the trusted
/// ones signed.
/// @throws DataError naming the file that cannot be used.
[[nodiscard]] std::unique_ptr<DcmTransportLayer> MakeDicomTls(const DicomTlsFiles& files,
                                                              DicomRole role);

}  // namespace plumb
