// SPDX-License-Identifier: Apache-2.0
// What Plumb takes from one DICOM file.
#pragma once

#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "algo/types/ct_image.hpp"
#include "algo/types/treatment_plan.hpp"

namespace plumb {

/// A file without a structure set, a plan, an image or its fault is of another kind, of which only
/// the rest is read.
struct PlanningContent {
  PlanningFile file;
  std::string modality;  ///< Such as "RTSTRUCT", as the file states it.
  std::optional<StructureSet> structures;
  std::optional<TreatmentPlan> plan;
  std::optional<CtImage> image;
  Message image_fault;  ///< Why a CT image has no `image`; empty otherwise.
};

/// Larger files are refused.
inline constexpr std::size_t kMostDicomBytes = std::size_t{64} << 20;
/// So are files with more points in all contours together.
inline constexpr std::size_t kMostContourPoints = 2'000'000;
/// And images with more rows or columns.
inline constexpr int kMostImageSide = 2048;

}  // namespace plumb
