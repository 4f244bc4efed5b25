// SPDX-License-Identifier: Apache-2.0
// From the files of a planning system to a scene, for the command line and the appliance.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/planning/planned_scene.hpp"
#include "drivers/dicom/planning_files.hpp"

namespace plumb {

/// A structure set and the plan made on it.
struct PlanningFiles {
  std::filesystem::path structures;  ///< Empty: there is none, only with images.
  std::filesystem::path plan;
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

/// The images of a CT, by whose skin a structure set without an external contour is replaced.
struct PlanningImages {
  /// Calls its argument for each of them, one after the other.
  std::function<void(const CtImageVisit& visit)> for_each;
  double threshold_hu = kSkinThreshold_hu;
};

/// Those of files and folders (see ForEachCtImage()).
/// @param stop  Noticed between two images: Interrupted.
/// @param progress  Called with the number of images that were read.
[[nodiscard]] PlanningImages ImagesIn(std::vector<std::filesystem::path> paths, double threshold_hu,
                                      std::stop_token stop,
                                      std::function<void(std::size_t)> progress = {});

/// The same with the images of the CT, for a structure set without an external contour or none
/// (see MakePlannedScene()). Takes some 0.1 s an image.
[[nodiscard]] ReadPlan ReadPlanningWithImages(const PlanningFiles& files,
                                              const PlanningImages& images,
                                              const PlanningChoice& choice);

/// `visit` with limits, looked at before each image.
/// @throws from what it returns: Interrupted on a stop request, DataError once `most` is over.
[[nodiscard]] CtImageVisit WithinTime(std::chrono::seconds most, const std::stop_token& stop,
                                      CtImageVisit visit);

/// Says it among the warnings of `scene` if the scene in that folder, which it follows, is of a
/// later plan.
void CompareWithEarlierPlan(const std::filesystem::path& folder, Scene& scene);

/// What an upload consists of, one after the other: the structure set, the plan, and images, each
/// behind its size in 8 bytes, little-endian.
struct SentParts {
  std::uint64_t structures_bytes = 0;  ///< 0: no structure set.
  std::uint64_t plan_bytes = 0;        ///< 0: up to the end, so that there are no images.
};

/// Writes the structure set, if there is one, and the plan of an upload to files of their own.
/// @throws DataError if one would be empty; IoError if the disk refuses.
void SplitPlanning(const std::filesystem::path& sent, const SentParts& parts,
                   const PlanningFiles& to);

/// Visits the images of an upload. Each is written to `scratch` for as long as it is read.
/// @throws DataError if there is none, or one is cut; as ReadCtImage().
void ForEachSentImage(const std::filesystem::path& sent, const SentParts& parts,
                      const std::filesystem::path& scratch, const CtImageVisit& visit);

}  // namespace plumb
