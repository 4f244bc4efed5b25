// SPDX-License-Identifier: Apache-2.0
// What the virtual sensor of the tests really shows.
#pragma once

#include <nlohmann/json.hpp>

namespace plumb::testing {

/// How far a computed motion misses the body's true one.
struct MotionError {
  double translation_m = 0;  ///< Displacement of the region's centroid.
  double rotation_rad = 0;
};

/// Of a result.json that compares the demo's second scene with its first, as the tests' plumbd
/// plays them. The truth comes from the simulator's plan, not from images.
[[nodiscard]] MotionError ErrorOfMotion(const nlohmann::json& result);

}  // namespace plumb::testing
