// SPDX-License-Identifier: Apache-2.0
// A scene from a planning system's structure set and plan.
#pragma once

#include <optional>
#include <string>

#include "algo/types/scene.hpp"
#include "algo/types/treatment_plan.hpp"

namespace plumb {

/// What a person chose where the files leave it open.
struct PlanningChoice {
  std::optional<std::string> roi = {};   ///< Name of the contour that is the surface.
  std::optional<std::string> beam = {};  ///< Name or number of the beam whose isocentre counts.
};

/// The surface of the external contour as a camera above sees it: in IEC axes, the isocentre at the
/// origin. What is missing, ambiguous or left out is among the warnings.
/// @throws DataError if the files do not belong together or must not be used, and where the choice
///         is needed: see docs/planning-ct.md, which lists every rule.
[[nodiscard]] Scene MakePlannedScene(const StructureSet& structures, const TreatmentPlan& plan,
                                     const PlanningChoice& choice = {});

}  // namespace plumb
