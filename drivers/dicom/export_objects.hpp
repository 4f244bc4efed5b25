// SPDX-License-Identifier: Apache-2.0
// Builds DICOM objects with DCMTK. Only in plumb-dicom-writer, a process of its own;
// dicom_export.hpp is what the programs use.
#pragma once

#include <cstdint>
#include <vector>

#include "drivers/dicom/export_content.hpp"

namespace plumb {

/// Prepares DCMTK; before the process gives up its rights.
/// @throws IoError if there is no data dictionary.
void PrepareDicomWriting();

/// The bytes of a DICOM file, explicit little endian.
/// @throws DataError if the object contradicts itself or DCMTK refuses a value.
[[nodiscard]] std::vector<std::uint8_t> EncodeDicom(const DicomExport& object);

}  // namespace plumb
