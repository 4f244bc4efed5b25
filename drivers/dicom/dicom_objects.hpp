// SPDX-License-Identifier: Apache-2.0
// Reads DICOM with DCMTK. Only in plumb-dicom-reader, a process of its own; planning_files.hpp is
// what the programs use.
#pragma once

#include <cstdint>
#include <span>

#include "drivers/dicom/planning_content.hpp"

namespace plumb {

/// Loads DCMTK's data dictionary and sets how it reads; before the process gives up its rights.
/// @throws IoError if there is no dictionary.
void PrepareDicom();

/// The values as the file states them; contours that are no polygons too.
/// @throws DataError for what is no DICOM file, is damaged, or is too large.
[[nodiscard]] PlanningContent ReadDicom(std::span<const std::uint8_t> bytes);

}  // namespace plumb
