#include "daemon/control/control_protocol.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <initializer_list>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;
using Kind = ControlRequest::Kind;

constexpr std::array<std::string_view, 8> kActions = {"plug",  "unplug",     "stall",  "resume",
                                                      "error", "next-scene", "glitch", "speed"};
constexpr std::size_t kMaxArgument = 80;
constexpr std::size_t kMaxFolder = 1024;

/// The argument is passed to the virtual sensor in one line with the action.
bool IsWords(const std::string& text) {
  return text.size() <= kMaxArgument && std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return std::isalnum(c) != 0 || c == '-' || c == '_' || c == '.' || c == ' ';
         });
}

bool IsBundleName(const std::string& text) {
  return text.size() <= 64 && text.ends_with(".raucb") && text.front() != '.' && IsWords(text) &&
         text.find(' ') == std::string::npos;
}

bool IsAbsolute(const std::string& path) {
  return path.starts_with('/') && path.size() <= kMaxFolder && path.find('\0') == std::string::npos;
}

}  // namespace

ControlRequest ParseControlRequest(std::string_view line) {
  if (line.size() > kMaxControlLine)
    throw DataError(
        fmt::format("a request has at most {} bytes, found {}", kMaxControlLine, line.size()));
  const Json json = ParseBoundedJsonOrNothing(line, /*max_depth=*/1);
  if (!json.is_object())
    throw DataError(
        "expected a request such as {\"command\": \"status\"}, found no flat JSON object");
  const auto text = [&](const char* key) {
    const auto value = json.find(key);
    return value != json.end() && value->is_string() ? value->get<std::string>() : std::string();
  };
  const auto allow_only = [&](std::initializer_list<std::string_view> keys) {
    for (const auto& [name, value] : json.items()) {
      if (std::find(keys.begin(), keys.end(), name) == keys.end())
        throw DataError(fmt::format("unknown key '{}' in the request", name.substr(0, 32)));
    }
  };
  ControlRequest request;
  const std::string command = text("command");
  if (command == "status" || command == "watch") {
    request.kind = command == "status" ? Kind::kStatus : Kind::kWatch;
    allow_only({"command"});
  } else if (command == "press") {
    request.kind = Kind::kPress;
    allow_only({"command", "long"});
    if (const auto is_long = json.find("long"); is_long != json.end()) {
      if (!is_long->is_boolean()) throw DataError("press: \"long\" is true or false");
      request.is_long = is_long->get<bool>();
    }
  } else if (command == "sim") {
    request.kind = Kind::kSim;
    allow_only({"command", "action", "argument"});
    request.action = text("action");
    if (std::find(kActions.begin(), kActions.end(), request.action) == kActions.end()) {
      throw DataError(fmt::format("sim: expected an action of {}", fmt::join(kActions, ", ")));
    }
    request.argument = text("argument");
    if ((json.contains("argument") && !json["argument"].is_string()) ||
        !IsWords(request.argument)) {
      throw DataError(fmt::format(
          "sim: \"argument\" is at most {} letters, digits, spaces, -, _ and dots", kMaxArgument));
    }
  } else if (command == "backup") {
    request.kind = Kind::kBackup;
    allow_only({"command", "folder", "key_file"});
    request.folder = text("folder");
    request.key_file = text("key_file");
    if (!IsAbsolute(request.folder)) throw DataError("backup: \"folder\" is an absolute path");
    if (json.contains("key_file") && !IsAbsolute(request.key_file))
      throw DataError("backup: \"key_file\" is an absolute path");
  } else if (command == "update") {
    request.kind = Kind::kUpdate;
    allow_only({"command", "name"});
    request.name = text("name");
    if (!IsBundleName(request.name))
      throw DataError(
          "update: \"name\" is at most 64 letters, digits, -, _ and dots, and ends with .raucb");
  } else if (command == "update-status" || command == "restart") {
    request.kind = command == "restart" ? Kind::kRestart : Kind::kUpdateStatus;
    allow_only({"command"});
  } else {
    throw DataError(
        "expected a command of status, press, watch, sim, backup, update, update-status, restart");
  }
  return request;
}

std::string ControlRequestText(const ControlRequest& request) {
  switch (request.kind) {
    case Kind::kStatus:
      return ControlLine({{"command", "status"}});
    case Kind::kWatch:
      return ControlLine({{"command", "watch"}});
    case Kind::kPress:
      return ControlLine({{"command", "press"}, {"long", request.is_long}});
    case Kind::kBackup: {
      Json backup{{"command", "backup"}, {"folder", request.folder}};
      if (!request.key_file.empty()) backup["key_file"] = request.key_file;
      return ControlLine(backup);
    }
    case Kind::kUpdate:
      return ControlLine({{"command", "update"}, {"name", request.name}});
    case Kind::kUpdateStatus:
      return ControlLine({{"command", "update-status"}});
    case Kind::kRestart:
      return ControlLine({{"command", "restart"}});
    case Kind::kSim:
      break;
  }
  Json sim = {{"command", "sim"}, {"action", request.action}};
  if (!request.argument.empty()) sim["argument"] = request.argument;
  return ControlLine(sim);
}

std::string ControlLine(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string ControlDone() { return R"({"ok":true})"; }

std::string ControlRefusal(std::string_view error, bool is_input) {
  Json refusal = {{"ok", false}, {"error", error}};
  if (is_input) refusal["input"] = true;
  return ControlLine(refusal);
}

}  // namespace plumb
