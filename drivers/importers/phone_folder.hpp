// SPDX-License-Identifier: Apache-2.0
// Folders that the apps of LiDAR phones export: Record3D and Stray Scanner.
#pragma once

#include <filesystem>
#include <memory>

#include "drivers/importers/file_recording.hpp"

namespace plumb {

/// True for a folder with Record3D's metadata.json, or with one that holds it (EXR_RGBD); or with
/// Stray Scanner's camera_matrix.csv and odometry.csv.
[[nodiscard]] bool IsPhoneFolder(const std::filesystem::path& folder);

/// Depth keeps its own resolution; its camera is the colour camera, smaller. Images belong together
/// by the numbers in their names, which also choose their stamps.
/// Depth is PNG in millimetres or OpenEXR in metres. Where the folder `confidence` has a map for an
/// image, depth with less than the highest confidence is left out.
/// @throws DataError for colour as a film, with the command that converts it; and as
///         OpenTumRecording().
[[nodiscard]] std::unique_ptr<ImportedRecording> OpenPhoneFolder(
    const std::filesystem::path& folder, const RecordingDefaults& defaults = {});

}  // namespace plumb
