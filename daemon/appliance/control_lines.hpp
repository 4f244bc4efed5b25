// Lines for the control socket's watchers: events, and what they have in common with the status.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "daemon/appliance/scan_session.hpp"
#include "daemon/appliance/scan_state.hpp"
#include "daemon/appliance/sensor_thread.hpp"
#include "drivers/indicator.hpp"

namespace plumb {

// Events, each {"event": NAME, ...}.
[[nodiscard]] nlohmann::json IgnoredEvent(ScanEvent what, ApplianceState state,
                                          const std::string& reason);
[[nodiscard]] nlohmann::json LightEvent(IndicatorPattern pattern);
[[nodiscard]] nlohmann::json ProgressEvent(const std::string& scan, const ScanUpdate& update,
                                           std::optional<double> coverage);
/// @param answer  The verdict, or why there is none.
[[nodiscard]] nlohmann::json ResultEvent(const std::string& scan, const std::string& answer);
[[nodiscard]] nlohmann::json SensorChanged(const SensorEvent& event);
/// @param reason  In a fault.
[[nodiscard]] nlohmann::json StateEvent(ApplianceState state, const std::string& reason,
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
