// SPDX-License-Identifier: Apache-2.0
// Folders of images that other programs write, without TUM's lists.
#pragma once

#include <filesystem>
#include <memory>

#include "drivers/importers/file_recording.hpp"

namespace plumb {

/// True for a folder of one of these layouts, by its names alone: `color` (or `colour`, `rgb`,
/// `image`, `images`) and `depth` with images in them, as Open3D's recorder and most scripts write;
/// or frame-NNNNNN.color.png beside frame-NNNNNN.depth.png (7-Scenes).
[[nodiscard]] bool IsImageFolder(const std::filesystem::path& folder);

/// Images whose names are stamps (seconds with decimals, or 13, 16 or 19 digits of milli-, micro-
/// or nanoseconds) are paired by these, others by the numbers in their names. The latter have no
/// stamps: the rate is RecordingDefaults::rate_hz, else what the calibration states, else 30, and a
/// warning says which.
/// The camera is from camera.yaml or from another program's calibration in the folder; 7-Scenes
/// has the camera that its authors publish, and depth that is not registered.
/// @throws DataError if there is no camera, and as OpenTumRecording().
[[nodiscard]] std::unique_ptr<ImportedRecording> OpenImageFolderRecording(
    const std::filesystem::path& folder, const RecordingDefaults& defaults = {});

}  // namespace plumb
