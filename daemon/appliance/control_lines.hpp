// Lines for the control socket's watchers: events, and what they have in common with the status.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include <nlohmann/json_fwd.hpp>

#include "daemon/appliance/scan_session.hpp"
#include "daemon/appliance/scan_state.hpp"
#include "daemon/appliance/sensor_thread.hpp"
#include "drivers/indicator.hpp"

namespace plumb {

struct IgnoredEvent {
  ScanEvent what;
  ApplianceState state;
  std::string reason;
};
struct LightEvent {
  IndicatorPattern pattern;
};
struct ProgressEvent {
  std::string scan;
  ScanUpdate update;
  std::optional<double> coverage;
};
struct ResultEvent {
  std::string scan;
  std::string answer;  ///< The verdict, or why there is none.
};
struct StateEvent {
  ApplianceState state;
  std::string reason;  ///< In a fault.
  bool cancelling;
};
using WatchedEvent =
    std::variant<IgnoredEvent, LightEvent, ProgressEvent, ResultEvent, SensorEvent, StateEvent>;

/// {"event": NAME, "time": seconds since 1970, ...}
[[nodiscard]] std::string EventLine(const WatchedEvent& event);
/// The first line for each watcher: the whole status, in the same form.
[[nodiscard]] std::string StatusEventLine(const nlohmann::json& status);

/// The fields of a scan in its events and in the status.
[[nodiscard]] nlohmann::json ProgressFields(const ScanUpdate& update,
                                            std::optional<double> coverage);
/// "off", "no_sensor", "ready", ...
[[nodiscard]] std::string_view Name(IndicatorPattern pattern);

}  // namespace plumb
