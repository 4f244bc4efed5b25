// SPDX-License-Identifier: Apache-2.0
// The document in a DICOM file, without DCMTK: what a patient's export travels in.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "drivers/dicom/export_content.hpp"

namespace plumb {

/// The bytes of the Encapsulated Document (0042,0011) of a Raw Data object, little endian, explicit
/// or implicit. Nothing says that they are what was sent: whoever uses them compares their digests.
/// @param most  Of the file; a larger one is refused unread.
/// @throws DataError for what is no such file, or contradicts itself.
[[nodiscard]] std::vector<std::uint8_t> EncapsulatedDocument(const std::filesystem::path& file,
                                                             std::size_t most = kMostExportBytes);

}  // namespace plumb
