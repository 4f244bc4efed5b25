// SPDX-License-Identifier: Apache-2.0
// ScanNet's .sens files, version 4: colour as JPEG or PNG, depth as zlib or plain.
#pragma once

#include <memory>

#include "drivers/importers/recorded_file.hpp"

namespace plumb {

/// Depth is that of a camera of its own. Its pose is taken only if both extrinsics are the
/// identity, as in what ScanNet publishes: the format does not say which way they map.
/// @throws DataError for a damaged file, another version, and packings that Plumb does not read.
[[nodiscard]] std::unique_ptr<RecordedFile> OpenSensFile(FileBytes bytes);

}  // namespace plumb
