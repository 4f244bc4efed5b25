// SPDX-License-Identifier: Apache-2.0
// DICOM files, written by plumb-dicom-writer in a process of its own.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "drivers/dicom/export_content.hpp"

namespace plumb {

/// Writes `file` (not atomically: into a folder that becomes visible later), in a folder in which
/// it may write a second file for a moment.
/// @throws DataError if the program refuses; IoError if the installation has no such program or the
///         disk refuses.
void WriteDicomExport(const DicomExport& object, const std::filesystem::path& file);

/// A unique identifier below 2.25: the same for the same content.
[[nodiscard]] std::string UidOfDigest(std::string_view sha256_hex);

}  // namespace plumb
