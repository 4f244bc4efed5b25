// One question to a running plumbd.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>

#include <nlohmann/json.hpp>

#include "daemon/control/control_protocol.hpp"

namespace plumb {

/// Returns the answer, a JSON object.
/// @param timeout_ms  Not set: waits without limit.
/// @throws DeviceError if no plumbd listens there or none answers; Interrupted
[[nodiscard]] nlohmann::json AskPlumbd(const std::filesystem::path& socket,
                                       const ControlRequest& request, const std::stop_token& stop,
                                       std::optional<int> timeout_ms);

}  // namespace plumb
