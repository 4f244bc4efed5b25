// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/live_acceptance.hpp"

#include <vector>

#include "algo/monitoring/monitor.hpp"
#include "web/model/limits.hpp"
#include "words/audit.hpp"
#include "words/monitoring.hpp"
#include "words/store.hpp"

namespace plumb {

Message WhyNotAcceptLive(const MonitorStatus& now, std::string_view accept_live, bool has_reason) {
  if (accept_live != kBySignature) return say::monitoring::AcceptNeedsSweep();
  if (!now.active) return say::monitoring::NotRunning();
  if (!now.judges_reference) return say::monitoring::AcceptNeedsReference();
  const bool is_known = now.state == Name(MonitorState::kMonitoring) && now.against_reference &&
                        now.age_s && *now.age_s <= kLongestGap_s &&
                        now.advice != Name(LiveAdvice::kUnknown);
  if (!is_known) return say::monitoring::AcceptUnknown();
  if (now.advice != Name(LiveAdvice::kIn) && !has_reason)
    return say::monitoring::AcceptNeedsReason();
  return {};
}

Message DescribeAccepted(const MonitorStatus& now, const std::string& reason) {
  std::vector<Message> numbers;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const NumberAxis& axis = kNumberAxes[i];
    const double value = now.against_reference->value[i];
    numbers.push_back(axis.is_shift() ? say::store::LogNumberMm(axis.name, value)
                                      : say::store::LogNumberDeg(axis.name, value));
  }
  return reason.empty() ? say::audit::LiveAccepted(now.advice, std::move(numbers))
                        : say::audit::LiveAcceptedOutside(now.advice, std::move(numbers), reason);
}

}  // namespace plumb
