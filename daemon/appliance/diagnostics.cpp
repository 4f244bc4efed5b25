#include "daemon/appliance/diagnostics.hpp"

#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/config/version.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;

Json Only(const Json& json, const auto& names) {
  Json kept = Json::object();
  if (!json.is_object()) return kept;
  for (const char* name : names)
    if (json.contains(name)) kept[name] = json[name];
  return kept;
}

}  // namespace

std::string DiagnosticsText(const Json& status, const web::Health& health, const std::string& loop,
                            const std::vector<web::AuditEntry>& audit) {
  constexpr std::array kStatus = {"state",       "reason", "sensor",   "light",
                                  "rolled_back", "page",   "warnings", "version"};
  constexpr std::array kLast = {"frames",          "frames_dropped",   "images_lost",
                                "images_unpaired", "images_discarded", "after_last_frame_s"};
  Json shown = Only(status, kStatus);
  if (status.contains("last_result")) shown["last_result"] = Only(status["last_result"], kLast);
  std::string text =
      fmt::format("plumbd {}\nhealth: {}\nstatus: {}\n\nthe event loop:\n{}\nlast actions:\n",
                  Version(), health.ok ? "ok" : health.reason,
                  shown.dump(-1, ' ', false, Json::error_handler_t::replace), loop);
  for (const web::AuditEntry& entry : audit)
    text += fmt::format("{} {}\n", entry.number, entry.action);
  return text;
}

}  // namespace plumb
