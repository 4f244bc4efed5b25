// SPDX-License-Identifier: Apache-2.0
// Asks for a modality worklist, by plumb-dicom-finder in a process of its own.
#pragma once

#include <vector>

#include "drivers/dicom/find_content.hpp"

namespace plumb {

/// Takes as long as the other side does, up to half a minute of silence.
/// @throws DataError if it cannot be asked or refuses, with its reason; IoError if this
/// installation
///         has no such program.
[[nodiscard]] std::vector<WorklistStep> FindWorklist(const WorklistRequest& request);

}  // namespace plumb
