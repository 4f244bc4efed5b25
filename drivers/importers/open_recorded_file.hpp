// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "drivers/importers/recorded_file.hpp"

namespace plumb {

/// Opens a file of any format that Plumb reads itself, by its first bytes.
/// @throws DataError if it is of none, or damaged.
[[nodiscard]] std::unique_ptr<RecordedFile> OpenRecordedFile(FileBytes bytes);

}  // namespace plumb
