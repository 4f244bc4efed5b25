#include "daemon/pipeline/learning_gate.hpp"

#include <fmt/format.h>

#include "algo/base/units.hpp"

namespace plumb {

std::string WhyNotLearned(const Scene& scene, const std::optional<Verdict>& verdict,
                          const AcceptanceLimits& limits) {
  if (verdict == Verdict::kNoAnswer) return "it gave no answer";
  if (static_cast<int>(scene.markers.size()) < limits.min_shared_markers)
    return fmt::format("{} markers were seen, at least {} are needed", scene.markers.size(),
                       limits.min_shared_markers);
  if (!(scene.longest_lost_s <= limits.max_lost_s))
    return fmt::format("tracking was lost for {:.1f} s, at most {:.1f} s are allowed",
                       scene.longest_lost_s, limits.max_lost_s);
  if (scene.breathing && scene.breathing->amplitude_m > limits.max_breathing_m)
    return fmt::format("the surface rose and fell by {:.1f} mm, at most {:.1f} mm are allowed",
                       scene.breathing->amplitude_m / kMillimetre,
                       limits.max_breathing_m / kMillimetre);
  return {};
}

}  // namespace plumb
