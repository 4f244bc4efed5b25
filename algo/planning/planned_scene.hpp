// SPDX-License-Identifier: Apache-2.0
// A scene from a planning system's structure set and plan.
#pragma once

#include <optional>
#include <string>

#include "algo/planning/ct_skin.hpp"
#include "algo/types/scene.hpp"
#include "algo/types/treatment_plan.hpp"

namespace plumb {

/// What a person chose where the files leave it open.
struct PlanningChoice {
  std::optional<std::string> roi = {};   ///< Name of the contour that is the surface.
  std::optional<std::string> beam = {};  ///< Name (or number) of the beam whose isocentre counts.
};

/// The surface of the external contour as a camera above sees it: in IEC axes, the isocentre at the
/// origin. What is missing, ambiguous or left out is among the warnings.
/// @throws DataError if the files do not belong together or must not be used, and where the choice
///         is needed: see docs/planning-ct.md, which lists every rule.
[[nodiscard]] Scene MakePlannedScene(const StructureSet& structures, const TreatmentPlan& plan,
                                     const PlanningChoice& choice = {});

/// The same with the images of the CT, whose skin is taken where the structure set has no external
/// contour and none is chosen, or where there is no structure set; otherwise a warning says that
/// they are not used. The couch is removed: by the structure set's contour of it, otherwise by its
/// shape.
[[nodiscard]] Scene MakePlannedScene(const std::optional<StructureSet>& structures,
                                     const TreatmentPlan& plan, const CtSkin& images,
                                     const PlanningChoice& choice = {});

}  // namespace plumb
