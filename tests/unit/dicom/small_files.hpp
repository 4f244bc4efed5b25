// SPDX-License-Identifier: Apache-2.0
// A small planning CT: a box of eight slices.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/files/file_io.hpp"
#include "drivers/simulator/suites/ct_images.hpp"
#include "drivers/simulator/suites/dicom_writer.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"

namespace plumb {

inline TriangleMesh BoxMesh() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.emplace_back((i & 1) != 0 ? 0.1F : -0.1F, (i & 2) != 0 ? 0.012F : -0.012F,
                               (i & 4) != 0 ? 0.1F : -0.1F);
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

inline std::pair<StructureSet, TreatmentPlan> SmallCt(
    const simulated::PlanningCtOptions& options = {}) {
  return simulated::MakePlanningCt(BoxMesh(), Pose::Identity(), options);
}

/// Its images, of pixels of 5 mm, on a couch.
inline std::vector<CtImage> SmallImages(const simulated::PlanningCtOptions& options = {}) {
  std::vector<CtImage> images;
  simulated::MakeCtImages(SmallCt(options).first, options, {.pixel_mm = 5.0},
                          [&](const CtImage& image) { images.push_back(image); });
  return images;
}

inline std::filesystem::path Written(const std::filesystem::path& file, const std::string& bytes) {
  WriteWholeFile(file, std::string_view(bytes));
  return file;
}

}  // namespace plumb
