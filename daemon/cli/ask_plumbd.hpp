// SPDX-License-Identifier: Apache-2.0
// One question to a running plumbd.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/message.hpp"
#include "daemon/control/control_protocol.hpp"

namespace plumb {

/// Returns the answer, a JSON object.
/// @param timeout_ms  Not set: waits without limit.
/// @throws DeviceError if no plumbd listens there or none answers; Interrupted
[[nodiscard]] nlohmann::ordered_json AskPlumbd(const std::filesystem::path& socket,
                                               const ControlRequest& request,
                                               const std::stop_token& stop,
                                               std::optional<int> timeout_ms);

/// What the answer says under this key, with its message beside it where plumbd sends one; empty if
/// it says nothing.
[[nodiscard]] Message SaidIn(const nlohmann::ordered_json& answer, const std::string& key);
/// The same for a list: for "warning" those of "warnings" and "warning_messages".
[[nodiscard]] std::vector<Message> AllSaidIn(const nlohmann::ordered_json& answer,
                                             const std::string& key);
/// Why plumbd refused a request.
[[nodiscard]] Message WhyRefused(const nlohmann::ordered_json& answer);

}  // namespace plumb
