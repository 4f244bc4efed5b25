// SPDX-License-Identifier: Apache-2.0
// From the files of a planning system to a scene, for the command line and the appliance.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

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

/// Says it among the warnings of `scene` if the scene in that folder, which it follows, is of a
/// later plan.
void CompareWithEarlierPlan(const std::filesystem::path& folder, Scene& scene);

/// Splits an upload, the structure set followed by the plan: what follows the first bytes is moved
/// to a file of its own.
/// @throws DataError if either would be empty; IoError if the disk refuses.
void SplitPlanning(const std::filesystem::path& both, std::uint64_t structures_bytes,
                   const std::filesystem::path& plan);

}  // namespace plumb
