// SPDX-License-Identifier: Apache-2.0
#include "daemon/pipeline/learning_gate.hpp"

#include "algo/base/units.hpp"
#include "words/learning.hpp"

namespace plumb {

Message WhyNotLearned(const Scene& scene, const std::optional<Verdict>& verdict,
                      const AcceptanceLimits& limits) {
  if (verdict == Verdict::kNoAnswer) return say::learning::NoAnswer();
  if (static_cast<int>(scene.markers.size()) < limits.min_shared_markers)
    return say::learning::FewMarkers(scene.markers.size(), limits.min_shared_markers);
  if (!(scene.longest_lost_s <= limits.max_lost_s))
    return say::learning::Lost(scene.longest_lost_s, limits.max_lost_s);
  if (scene.breathing && scene.breathing->amplitude_m > limits.max_breathing_m)
    return say::learning::Breathing(scene.breathing->amplitude_m / kMillimetre,
                                    limits.max_breathing_m / kMillimetre);
  return {};
}

}  // namespace plumb
