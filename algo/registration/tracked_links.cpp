// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/tracked_links.hpp"

#include "algo/map/keyframe_link.hpp"

namespace plumb {

void AddTrackedLinks(const TrackingMap& map, std::vector<QuadraticTerm>& terms) {
  // Standard deviations of depth-only tracking over the next few centimetres of motion. Negligible
  // against the hundreds of observations elsewhere.
  constexpr double kSigma_rad = 0.004;
  constexpr double kSigma_m = 0.006;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    const MapKeyframe& keyframe = map.keyframes[k];
    if (!keyframe.previous) continue;
    const MapKeyframe& previous = map.keyframe(*keyframe.previous);
    if (IsConstrained(map, keyframe) && IsConstrained(map, previous)) continue;
    const LinkEquations link =
        Linearise({*keyframe.previous, static_cast<int>(k), keyframe.T_previous_color},
                  previous.T_world_color, keyframe.T_world_color, kSigma_rad, kSigma_m);
    QuadraticTerm term;
    term.keyframe_a = *keyframe.previous;
    term.keyframe_b = static_cast<int>(k);
    term.H.topLeftCorner<12, 12>() = link.H;
    term.g.head<12>() = link.g;
    terms.push_back(term);
  }
}

}  // namespace plumb
