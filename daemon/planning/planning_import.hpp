// SPDX-License-Identifier: Apache-2.0
// From the files of a planning system to a scene, for the command line and the appliance.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/planning/planned_scene.hpp"

namespace plumb {

/// A structure set and the plan made on it.
struct PlanningFiles {
  std::filesystem::path structures, plan;
  /// What messages call them; empty: their paths.
  std::filesystem::path structures_name = {}, plan_name = {};
};

struct ReadPlan {
  Scene scene;
  /// As the files state it; only to be compared (PatientHash()), never to be kept or shown.
  std::string patient_id;
};

/// Both files are read by plumb-dicom-reader, a process of its own; takes up to a minute.
/// @throws DataError as of MakePlannedScene() and for files that cannot be read; IoError if this
///         installation has no reader.
[[nodiscard]] ReadPlan ReadPlanning(const PlanningFiles& files, const PlanningChoice& choice);

/// The same with the images of the CT, for a structure set without an external contour or none
/// (see MakePlannedScene()). Takes some 0.1 s an image.
/// @param images  Files and folders; see ForEachCtImage().
/// @param progress  Called with the number of images that were read.
/// @throws Interrupted on a stop request, which is noticed between two images.
[[nodiscard]] Scene ReadPlanningWithImages(const std::optional<std::filesystem::path>& structures,
                                           const std::filesystem::path& plan,
                                           const std::vector<std::filesystem::path>& images,
                                           double threshold_hu, const PlanningChoice& choice,
                                           const std::stop_token& stop,
                                           const std::function<void(std::size_t)>& progress = {});

/// Says it among the warnings of `scene` if the scene in that folder, which it follows, is of a
/// later plan.
void CompareWithEarlierPlan(const std::filesystem::path& folder, Scene& scene);

/// Splits an upload, the structure set followed by the plan: what follows the first bytes is moved
/// to a file of its own.
/// @throws DataError if either would be empty; IoError if the disk refuses.
void SplitPlanning(const std::filesystem::path& both, std::uint64_t structures_bytes,
                   const std::filesystem::path& plan);

}  // namespace plumb
