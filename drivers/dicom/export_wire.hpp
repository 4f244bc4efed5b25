// SPDX-License-Identifier: Apache-2.0
// What plumb-dicom-writer is told, and what it answers: facts as JSON, then the payload.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "drivers/dicom/export_content.hpp"

namespace plumb {

/// Stands before the request and before the answer.
struct ExportHeader {
  static constexpr std::uint32_t kMagic = 0x31574450;  // "PDW1"
  std::uint32_t magic = kMagic;
  std::uint32_t is_error = 0;       ///< 1: the text is that of ReaderErrorText().
  std::uint64_t text_bytes = 0;     ///< Facts of the request, or the error.
  std::uint64_t payload_bytes = 0;  ///< Of the request its payload, of the answer the DICOM file.
};
inline constexpr std::size_t kMostExportFacts = std::size_t{64} << 10;

/// All but the payload.
[[nodiscard]] std::string ExportFactsOf(const DicomExport& object);
/// @throws DataError for what is no such text.
[[nodiscard]] DicomExport ParseExportFacts(std::string_view facts);

}  // namespace plumb
