#include "daemon/pipeline/keypoint_budget.hpp"

namespace plumb {

bool NextFewerKeypoints(bool fewer, int stride, const TrackingLoad& load,
                        const KeypointBudgetOptions& options) {
  if (!(load.frame_period_s > 0) || !(load.tracking_s > 0)) return fewer;
  const double load_of_all = load.tracking_s / load.frame_period_s;
  if (!fewer)
    return load.late_s >= options.reduce_late_s && load_of_all > options.reduce_load * stride;
  return stride > 1 || load.late_s > options.restore_late_s ||
         load.since_change_s < options.restore_hold_s || load_of_all > options.restore_load;
}

}  // namespace plumb
