// RESULT folders: what `plumb compare` leaves.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <opencv2/core/mat.hpp>

#include "algo/comparison/comparison.hpp"
#include "algo/types/height_map.hpp"
#include "daemon/files/atomic_folder.hpp"

namespace plumb {

/// result.json, deviation.tiff, distance.tiff, deviation_after.tiff, deformation.ply,
/// error_map.png, overlay.png, region.png (the region that was compared, where there is one).
[[nodiscard]] OutputKind ResultOutput();

/// Which signed calibration of the room gave the numbers their axes.
struct ResultRoom {
  int version = 0;
  std::string why_not_used;  ///< Empty: it was. Else the axes are those of the reference marker.
};

/// The text of result.json, also what `compare --json` prints. Absent results are null; numbers
/// read back bit for bit.
/// @param room  None: no calibration was signed; the configuration's axes, if any.
[[nodiscard]] std::string ResultJson(const Comparison& comparison,
                                     const std::optional<ResultRoom>& room = {});

struct PictureOptions {
  double tolerance_m = 3 * kMillimetre;  ///< That the colour scale is tied to.
  bool paper_colors = false;             ///< The paper's scale, blue at 0 to red at 10 cm.
  std::string subtitle;
};

/// CV_8UC3 RGB, or empty where there is nothing to draw.
struct ResultPictures {
  cv::Mat error_map;
  cv::Mat overlay;
};

/// @param reference_height  Of the reference scene; null where it has none.
[[nodiscard]] ResultPictures DrawResult(const Comparison& comparison,
                                        const HeightMap* reference_height,
                                        const PictureOptions& options = {});

/// Writes a result, whole or not at all; replaces an older result at that place. Maps and pictures
/// that do not exist are left out. Same comparison, same bytes.
/// @throws IoError
void WriteResult(const Comparison& comparison, const ResultPictures& pictures,
                 const std::filesystem::path& folder, const std::optional<ResultRoom>& room = {});

/// The text of a result's result.json, checked to be JSON of a format that this version knows.
/// @throws DataError
[[nodiscard]] std::string ReadResultJson(const std::filesystem::path& folder);

/// True if the folder looks like one: it holds result.json.
[[nodiscard]] bool IsResultFolder(const std::filesystem::path& folder);

}  // namespace plumb
