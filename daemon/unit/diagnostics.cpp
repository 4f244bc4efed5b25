// SPDX-License-Identifier: Apache-2.0
#include "daemon/unit/diagnostics.hpp"

#include <algorithm>
#include <array>
#include <string_view>

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

/// Without numbers and paths: a scan's number or a folder's name can lead to a patient.
std::string Masked(std::string_view text) {
  std::string masked;
  while (!text.empty()) {
    const std::size_t end = text.find_first_of(" \t\n\"'(),;");
    const std::string_view word = text.substr(0, end);
    if (word.find('/') != std::string_view::npos) {
      masked += "<path>";
    } else {
      for (const char c : word) {
        const bool is_digit = c >= '0' && c <= '9';
        if (!is_digit || !masked.ends_with('#')) masked += is_digit ? '#' : c;
      }
    }
    if (end == std::string_view::npos) break;
    masked += text[end];
    text.remove_prefix(end + 1);
  }
  return masked;
}

void Mask(Json& json) {
  if (json.is_string()) json = Masked(json.get<std::string>());
  if (json.is_array()) std::for_each(json.begin(), json.end(), Mask);
}

}  // namespace

std::string DiagnosticsText(const Json& status, const Health& health, const std::string& loop,
                            const std::vector<AuditEntry>& audit) {
  constexpr std::array kStatus = {"state",       "reason", "sensor",   "light",
                                  "rolled_back", "page",   "warnings", "version"};
  constexpr std::array kLast = {"frames",          "frames_dropped",   "images_lost",
                                "images_unpaired", "images_discarded", "after_last_frame_s"};
  Json shown = Only(status, kStatus);
  for (const char* free_text : {"reason", "rolled_back", "warnings"})
    if (shown.contains(free_text)) Mask(shown[free_text]);
  if (status.contains("last_result")) shown["last_result"] = Only(status["last_result"], kLast);
  std::string text =
      fmt::format("plumbd {}\nhealth: {}\nstatus: {}\n\nthe event loop:\n{}\nlast actions:\n",
                  Version(), health.ok ? "ok" : Masked(health.reason.English()),
                  shown.dump(-1, ' ', false, Json::error_handler_t::replace), loop);
  for (const AuditEntry& entry : audit) text += fmt::format("{} {}\n", entry.number, entry.action);
  return text;
}

}  // namespace plumb
