// SPDX-License-Identifier: Apache-2.0
// RESULT folders, which `plumb compare` writes.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "algo/comparison/comparison.hpp"
#include "algo/types/height_map.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/result/stored_result.hpp"

namespace plumb {

/// result.json, deviation.tiff, distance.tiff, deviation_after.tiff, deformation.ply,
/// error_map.png, overlay.png, region.png (the compared region, if there is one).
[[nodiscard]] OutputKind ResultOutput();

/// The signed calibration of the room that determined the axes of the numbers.
struct ResultRoom {
  int version = 0;
  /// Empty if it was used; otherwise the axes are those of the reference marker.
  Message why_not_used;
};

/// What result.json has of a comparison.
/// @param room  Not set: no calibration was signed, and the axes are those of the configuration, if
///         any.
[[nodiscard]] StoredResult Stored(const Comparison& comparison,
                                  const std::optional<ResultRoom>& room = {});

struct PictureOptions {
  /// Tolerance of the colour scale.
  double tolerance_m = kDefaultShiftTolerance_mm * kMillimetre;
  bool paper_colors = false;  ///< Use the paper's scale, blue at 0 to red at 10 cm.
  std::string subtitle;
};

/// CV_8UC3 RGB; empty if there is nothing to draw.
struct ResultPictures {
  cv::Mat error_map;
  cv::Mat overlay;
};

/// @param reference_height  Of the reference scene; null if it has none.
[[nodiscard]] ResultPictures DrawResult(const Comparison& comparison,
                                        const HeightMap* reference_height,
                                        const PictureOptions& options = {});

/// Writes a result, completely or not at all, and replaces an older result at that place. Maps and
/// pictures that do not exist are left out. The same comparison gives the same bytes.
/// @throws IoError
void WriteResult(const Comparison& comparison, const ResultPictures& pictures,
                 const std::filesystem::path& folder, const std::optional<ResultRoom>& room = {});

/// @throws DataError as ParseResult(), IoError
[[nodiscard]] StoredResult ReadResult(const std::filesystem::path& folder);

/// True if the folder looks like a result: it contains result.json.
[[nodiscard]] bool IsResultFolder(const std::filesystem::path& folder);

}  // namespace plumb
