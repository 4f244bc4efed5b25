#include "daemon/pipeline/learning_gate.hpp"

#include <fmt/format.h>

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
  return {};
}

}  // namespace plumb
