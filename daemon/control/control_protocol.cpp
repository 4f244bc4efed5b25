#include "daemon/control/control_protocol.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "algo/types/errors.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;
using Kind = ControlRequest::Kind;

constexpr std::array<std::string_view, 6> kActions = {"plug", "unplug", "stall", "resume", "error", "next-scene"};

bool IsFlat(const Json& json) {
  return std::all_of(json.begin(), json.end(), [](const Json& value) { return !value.is_structured(); });
}

}  // namespace

ControlRequest ParseControlRequest(std::string_view line) {
  if (line.size() > kMaxControlLine) throw DataError(fmt::format("a request has at most {} bytes, found {}", kMaxControlLine, line.size()));
  const auto refuse_nesting = [](int depth, Json::parse_event_t, Json&) {
    if (depth > 2) throw DataError("a request is a flat JSON object, found a nested one");
    return true;
  };
  const Json json = Json::parse(line, refuse_nesting, /*allow_exceptions=*/false);
  if (!json.is_object() || !IsFlat(json))
    throw DataError("expected a request such as {\"command\": \"status\"}, found no flat JSON object");
  const auto text = [&](const char* key) {
    const auto value = json.find(key);
    return value != json.end() && value->is_string() ? value->get<std::string>() : std::string();
  };
  const auto allow_only = [&](const char* key) {
    for (const auto& [name, value] : json.items()) {
      if (name != "command" && name != key) throw DataError(fmt::format("unknown key '{}' in the request", name.substr(0, 32)));
    }
  };
  ControlRequest request;
  const std::string command = text("command");
  if (command == "status" || command == "watch") {
    request.kind = command == "status" ? Kind::kStatus : Kind::kWatch;
    allow_only("command");
  } else if (command == "press") {
    request.kind = Kind::kPress;
    allow_only("long");
    if (const auto is_long = json.find("long"); is_long != json.end()) {
      if (!is_long->is_boolean()) throw DataError("press: \"long\" is true or false");
      request.is_long = is_long->get<bool>();
    }
  } else if (command == "sim") {
    request.kind = Kind::kSim;
    allow_only("action");
    request.action = text("action");
    if (std::find(kActions.begin(), kActions.end(), request.action) == kActions.end()) {
      throw DataError(fmt::format("sim: expected an action of {}", fmt::join(kActions, ", ")));
    }
  } else {
    throw DataError("expected a command of status, press, watch, sim");
  }
  return request;
}

std::string ControlRequestText(const ControlRequest& request) {
  switch (request.kind) {
    case Kind::kStatus:
      return Json{{"command", "status"}}.dump();
    case Kind::kWatch:
      return Json{{"command", "watch"}}.dump();
    case Kind::kPress:
      return Json{{"command", "press"}, {"long", request.is_long}}.dump();
    case Kind::kSim:
      break;
  }
  return Json{{"command", "sim"}, {"action", request.action}}.dump();
}

std::string ControlDone() { return R"({"ok":true})"; }

std::string ControlRefusal(std::string_view error) {
  return Json{{"ok", false}, {"error", error}}.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace plumb
