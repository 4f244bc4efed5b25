// SPDX-License-Identifier: Apache-2.0
// What the readers of folders of images share.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "drivers/importers/file_recording.hpp"

namespace plumb {

/// Whether a name has this ending, given in small letters, in small or capital ones.
[[nodiscard]] bool EndsLike(std::string_view name, std::string_view ending);

/// Whether a file's name is that of an image: a PNG or, for colour, a JPEG.
/// @param ending  Of the name, in small letters; empty: any image.
[[nodiscard]] bool IsImageName(const std::string& name, std::string_view ending, bool is_depth);

/// Names of images, relative to the recording's folder, by the last number in each.
using Numbered = std::map<std::int64_t, std::string>;

/// @param sub  Folder of the images within the recording's; empty: the recording's own.
/// @throws DataError for a name without a number and for two images with the same.
[[nodiscard]] Numbered NumberedImages(const std::filesystem::path& folder, const std::string& sub,
                                      std::string_view ending, bool is_depth);

/// A folder of images whose lists and camera are known. @throws DataError as OpenTumRecording().
[[nodiscard]] std::unique_ptr<ImportedRecording> OpenListedFolder(
    ImageFolder contents, ImportedFacts facts, const RecordingDefaults& defaults);

}  // namespace plumb
