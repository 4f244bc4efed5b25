// SPDX-License-Identifier: Apache-2.0
// The pictures of a report, drawn from the stored maps in the report's language.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/comparison/body_parts.hpp"
#include "algo/render/picture_words.hpp"
#include "algo/types/scene.hpp"
#include "daemon/files/map_marks.hpp"
#include "daemon/result/stored_result.hpp"
#include "web/model/reference.hpp"

namespace plumb {

/// Error map and overlay of a comparison, CV_8UC3 RGB. The marks name the patient's sides and the
/// gantry, as far as the result knows them. A picture whose files are missing or damaged is left
/// out.
/// @param reference_folder  Folder of the reference's scan.
/// @param result  Not set where it cannot be read: then no side is named.
[[nodiscard]] std::vector<cv::Mat> ComparisonPictures(const std::filesystem::path& scan_folder,
                                                      const std::filesystem::path& reference_folder,
                                                      const std::optional<StoredResult>& result,
                                                      double tolerance_m, const PictureWords& words,
                                                      const SideWords& sides);

/// Where the room lies on the maps of a scene with these markers; nothing where it is not known.
using RoomFinder = std::function<std::optional<RoomWays>(const MarkerMap& scene)>;

struct PlanPictures {
  std::vector<cv::Mat> pictures;
  bool names_sides = false;  ///< Those of the planned posture: nothing has been compared.
};

/// The heights of a reference with the planned region outlined and the isocentre marked; nothing if
/// the files are missing or damaged. In a known room the marks name the sides that the patient has
/// in the planned posture.
/// @param room_in  Empty: the room is not known.
[[nodiscard]] PlanPictures ReferencePictures(const std::filesystem::path& scan_folder,
                                             const ReferencePlan& plan, const RoomFinder& room_in,
                                             const PictureWords& words, const SideWords& sides);

}  // namespace plumb
