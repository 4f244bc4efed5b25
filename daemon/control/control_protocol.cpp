// SPDX-License-Identifier: Apache-2.0
#include "daemon/control/control_protocol.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "words/control.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;
using Kind = ControlRequest::Kind;

constexpr std::array<std::string_view, 10> kActions = {
    "plug", "unplug", "stall", "resume", "error", "next-scene", "glitch", "speed", "mount", "move"};
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

std::string TextOf(const Json& json, const char* key) {
  const auto value = json.find(key);
  return value != json.end() && value->is_string() ? value->get<std::string>() : std::string();
}

void ReadNothing(const Json&, ControlRequest&) {}

void ReadPress(const Json& json, ControlRequest& request) {
  const auto is_long = json.find("long");
  if (is_long == json.end()) return;
  if (!is_long->is_boolean()) throw DataError(say::control::PressLong());
  request.is_long = is_long->get<bool>();
}

void ReadSim(const Json& json, ControlRequest& request) {
  request.action = TextOf(json, "action");
  if (std::find(kActions.begin(), kActions.end(), request.action) == kActions.end())
    throw DataError(say::control::SimAction({kActions.begin(), kActions.end()}));
  request.argument = TextOf(json, "argument");
  if ((json.contains("argument") && !json["argument"].is_string()) || !IsWords(request.argument))
    throw DataError(say::control::SimArgument(kMaxArgument));
}

void ReadMonitor(const Json& json, ControlRequest& request) {
  const std::string action = TextOf(json, "action");
  if (action != "start" && action != "stop") throw DataError(say::control::MonitorAction());
  request.starts = action == "start";
}

void ReadBackup(const Json& json, ControlRequest& request) {
  request.folder = TextOf(json, "folder");
  if (!IsAbsolute(request.folder)) throw DataError(say::control::AbsolutePath("folder"));
  const auto keys = json.find("recipients");
  if (keys == json.end()) return;
  const bool are_texts =
      keys->is_array() && !keys->empty() &&
      std::all_of(keys->begin(), keys->end(), [](const Json& key) { return key.is_string(); });
  if (!are_texts) throw DataError(say::control::Recipients(AgeRecipients::kMost));
  request.recipients = AgeRecipients(keys->get<std::vector<std::string>>());
}

void ReadUpdate(const Json& json, ControlRequest& request) {
  request.name = TextOf(json, "name");
  if (!IsBundleName(request.name)) throw DataError(say::control::BundleName());
}

struct CommandSyntax {
  std::string_view name;
  Kind kind;
  std::array<std::string_view, 2> keys;  ///< Beside "command"; empty: none.
  void (*read)(const Json& json, ControlRequest& request);
};
constexpr std::array<CommandSyntax, 11> kCommands = {{
    {"status", Kind::kStatus, {}, ReadNothing},
    {"press", Kind::kPress, {"long"}, ReadPress},
    {"watch", Kind::kWatch, {}, ReadNothing},
    {"sim", Kind::kSim, {"action", "argument"}, ReadSim},
    {"backup", Kind::kBackup, {"folder", "recipients"}, ReadBackup},
    {"update", Kind::kUpdate, {"name"}, ReadUpdate},
    {"update-status", Kind::kUpdateStatus, {}, ReadNothing},
    {"restart", Kind::kRestart, {}, ReadNothing},
    {"presence", Kind::kPresence, {}, ReadNothing},
    {"monitor", Kind::kMonitor, {"action"}, ReadMonitor},
    {"test-message", Kind::kTestMessage, {}, ReadNothing},
}};

const CommandSyntax& SyntaxOf(std::string_view command) {
  for (const CommandSyntax& syntax : kCommands)
    if (syntax.name == command) return syntax;
  std::vector<std::string> names;
  for (const CommandSyntax& syntax : kCommands) names.emplace_back(syntax.name);
  throw DataError(say::control::UnknownCommand(names));
}

}  // namespace

ControlRequest ParseControlRequest(std::string_view line) {
  if (line.size() > kMaxControlLine)
    throw DataError(
        say::control::LongRequest(kMaxControlLine, static_cast<std::int64_t>(line.size())));
  const Json json = ParseBoundedJsonOrNothing(line, /*max_depth=*/2);
  if (!json.is_object()) throw DataError(say::control::NoObject("{\"command\": \"status\"}"));
  const CommandSyntax& syntax = SyntaxOf(TextOf(json, "command"));
  for (const auto& [name, value] : json.items()) {
    const bool is_known =
        name == "command" || (!name.empty() && std::find(syntax.keys.begin(), syntax.keys.end(),
                                                         name) != syntax.keys.end());
    if (!is_known) throw DataError(say::control::UnknownKey(name.substr(0, 32)));
  }
  ControlRequest request;
  request.kind = syntax.kind;
  syntax.read(json, request);
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
      if (!request.recipients.empty()) backup["recipients"] = request.recipients.keys();
      return ControlLine(backup);
    }
    case Kind::kUpdate:
      return ControlLine({{"command", "update"}, {"name", request.name}});
    case Kind::kUpdateStatus:
      return ControlLine({{"command", "update-status"}});
    case Kind::kRestart:
      return ControlLine({{"command", "restart"}});
    case Kind::kPresence:
      return ControlLine({{"command", "presence"}});
    case Kind::kTestMessage:
      return ControlLine({{"command", "test-message"}});
    case Kind::kMonitor:
      return ControlLine({{"command", "monitor"}, {"action", request.starts ? "start" : "stop"}});
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

std::string ControlRefusal(const Message& why, bool is_input) {
  Json refusal = {{"ok", false}, {"error", why.English()}, {"error_message", MessageJson(why)}};
  if (is_input) refusal["input"] = true;
  return ControlLine(refusal);
}

}  // namespace plumb
