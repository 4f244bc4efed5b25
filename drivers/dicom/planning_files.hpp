// SPDX-License-Identifier: Apache-2.0
// Structure sets, plans and other DICOM files, read by plumb-dicom-reader in a process of its own.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "drivers/dicom/planning_content.hpp"

namespace plumb {

/// True for a file that begins as DICOM files do.
[[nodiscard]] bool IsDicomFile(const std::filesystem::path& file);

/// @throws DataError if it cannot be read, is damaged, or needs too much memory or time; IoError if
///         this installation has no reader.
/// @param name  What messages call the file; empty: its path.
[[nodiscard]] PlanningContent ReadDicomFile(const std::filesystem::path& file,
                                            const std::filesystem::path& name = {});

/// @throws DataError as above, and if it is a file of another kind.
[[nodiscard]] StructureSet ReadStructureSet(const std::filesystem::path& file,
                                            const std::filesystem::path& name = {});
[[nodiscard]] TreatmentPlan ReadTreatmentPlan(const std::filesystem::path& file,
                                              const std::filesystem::path& name = {});

/// @throws DataError as above, also with the image's fault.
[[nodiscard]] CtImage ReadCtImage(const std::filesystem::path& file,
                                  const std::filesystem::path& name = {});

/// Takes an image, and what messages call it.
using CtImageVisit = std::function<void(const CtImage&, const std::string& name)>;

/// Visits the CT images among files, one after the other, so that only one is in memory.
/// @param paths  Files, and folders whose DICOM files count; structure sets and plans that lie in a
///               folder beside the images are left out.
/// @throws DataError as above, for images of another kind, and for a folder without DICOM files.
void ForEachCtImage(const std::vector<std::filesystem::path>& paths, const CtImageVisit& visit);

}  // namespace plumb
