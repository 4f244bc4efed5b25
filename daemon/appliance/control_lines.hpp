// SPDX-License-Identifier: Apache-2.0
// Lines for the control socket's watchers: events, and what they have in common with the status.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "daemon/appliance/scan_state.hpp"
#include "daemon/scanning/scan_session.hpp"
#include "daemon/sweep/sensor_thread.hpp"
#include "drivers/indicator.hpp"

namespace plumb {

/// Adds KEY with the English sentence, and KEY_message with the message as in message_json.hpp: ""
/// and null if it is empty.
void PutMessage(nlohmann::json& json, const std::string& key, const Message& message);
/// Adds KEYs with the English sentences and KEY_messages with the messages, in the same order.
void PutMessages(nlohmann::json& json, const std::string& key,
                 const std::vector<Message>& messages);

// Events, each {"event": NAME, ...}.
[[nodiscard]] nlohmann::json IgnoredEvent(ScanEvent what, ApplianceState state,
                                          const Message& reason);
[[nodiscard]] nlohmann::json LightEvent(IndicatorPattern pattern);
[[nodiscard]] nlohmann::json ProgressEvent(const std::string& scan, const ScanUpdate& update,
                                           std::optional<double> coverage);
/// @param answer  The verdict, or why there is none.
[[nodiscard]] nlohmann::json ResultEvent(const std::string& scan, const Message& answer);
[[nodiscard]] nlohmann::json SensorChanged(const SensorEvent& event);
/// @param reason  In a fault.
[[nodiscard]] nlohmann::json StateEvent(ApplianceState state, const Message& reason,
                                        bool cancelling);

/// An event with "time", in seconds since 1970.
[[nodiscard]] std::string EventLine(nlohmann::json event);
/// The first line for each watcher: the whole status, in the same form.
[[nodiscard]] std::string StatusEventLine(const nlohmann::json& status);

/// The fields of a scan in its events and in the status.
[[nodiscard]] nlohmann::json ProgressFields(const ScanUpdate& update,
                                            std::optional<double> coverage);
/// "off", "no_sensor", "ready", ...
[[nodiscard]] std::string_view Name(IndicatorPattern pattern);

}  // namespace plumb
