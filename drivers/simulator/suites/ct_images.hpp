// SPDX-License-Identifier: Apache-2.0
// The images of a simulated planning CT: what its structure set encloses, on a couch.
#pragma once

#include <functional>
#include <string>

#include "algo/types/ct_image.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"

namespace plumb::simulated {

struct CtImageOptions {
  double pixel_mm = 1.2;
  double blur_mm = 0.6;  ///< Standard deviation, in the plane of the image.
  double noise_hu = 15.0;
  bool has_couch = true;  ///< Flat, 6 cm wider than the body on each side, which lies on it.
};

/// Makes one image for each slice, without a thickness: "BODY" is soft tissue, and the organ in it
/// holds air, as a lung does.
/// @param options  Those that made the files.
/// @param visit  Called for each image, in the order of the slices.
void MakeCtImages(const StructureSet& structures, const PlanningCtOptions& options,
                  const CtImageOptions& of_images,
                  const std::function<void(const CtImage&)>& visit);

}  // namespace plumb::simulated
