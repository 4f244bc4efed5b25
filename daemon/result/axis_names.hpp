// SPDX-License-Identifier: Apache-2.0
// The names of the six numbers of a stored result.
#pragma once

#include <array>
#include <optional>

#include "algo/base/message.hpp"
#include "daemon/result/stored_result.hpp"

namespace plumb {

/// In the order of kNumberNames. If the room was not known, the numbers run along the axes of the
/// reference marker. Each is then named after the patient's axis that lies along it, in agreement
/// with the words of its direction, or else after the marker's axis; never after one of the couch.
[[nodiscard]] std::array<Message, 6> AxisNames(const std::optional<StoredBody>& body);

}  // namespace plumb
