// SPDX-License-Identifier: Apache-2.0
// Whether a sensor unit's profile learns from a sweep.
#pragma once

#include <optional>

#include "algo/base/message.hpp"
#include "algo/types/scene.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

/// Why the profile does not learn from a completed scan; empty if it may. Uses the gates of the
/// comparison that need only one scene.
/// @param verdict  Of its comparison or check, if there was one.
[[nodiscard]] Message WhyNotLearned(const Scene& scene, const std::optional<Verdict>& verdict,
                                    const AcceptanceLimits& limits);

}  // namespace plumb
