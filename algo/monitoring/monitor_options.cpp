// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/comparison.hpp"
#include "algo/monitoring/monitor.hpp"
#include "words/monitoring.hpp"

namespace plumb {

MonitorOptions MonitorOptionsOf(const CompareOptions& compare, const Scene* reference,
                                const Scene& current, std::vector<Message>& warnings) {
  MonitorOptions options{.limits = compare.limits,
                         .T_iec_reference = compare.T_iec_reference,
                         .judges_reference = reference != nullptr,
                         .region_polygon_m = compare.region_polygon_m};
  if (reference == nullptr) return options;
  const Comparison comparison = Compare(*reference, current, compare);
  if (comparison.verdict == Verdict::kNoAnswer || !comparison.motion || !comparison.alignment) {
    warnings.push_back(say::monitoring::NoReference(
        comparison.reasons.empty() ? Message() : comparison.reasons.front()));
    return options;
  }
  // The motion against a planning CT is stated in the current scan's frame.
  options.accepted = {.T_reference_current = reference->planning
                                                 ? Pose::Identity()
                                                 : comparison.alignment->T_reference_current,
                      .T_motion = comparison.motion->T,
                      .covariance = comparison.motion->covariance,
                      .centroid_m = comparison.motion->centroid_m};
  return options;
}

}  // namespace plumb
