// SPDX-License-Identifier: Apache-2.0
// Recordings of other programs, of any kind that Plumb reads itself.
#pragma once

#include <filesystem>
#include <memory>

#include "drivers/importers/file_recording.hpp"

namespace plumb {

/// Whether it looks like one; recordings in Plumb's own layout do not.
[[nodiscard]] bool IsImportable(const std::filesystem::path& path);

/// @throws DataError, IoError as OpenFileRecording() and OpenImageFolderRecording().
[[nodiscard]] std::unique_ptr<ImportedRecording> OpenImported(
    const std::filesystem::path& path, const RecordingDefaults& defaults = {});

/// @throws DataError for a recording of a format that Plumb knows but does not read, or a folder
///         with one, with the one command that converts it.
void RefuseUnreadFormat(const std::filesystem::path& path);

}  // namespace plumb
