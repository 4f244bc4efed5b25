// SPDX-License-Identifier: Apache-2.0
#include "algo/base/message_json.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;
using Value = MessageArgument::Value;

// A sentence with words in it that have words in them; no message nests more deeply.
constexpr int kMaxMessageDepth = 6;

Json ValueJson(const std::string& text) { return text; }
Json ValueJson(std::int64_t number) { return number; }
Json ValueJson(const Message& message) { return MessageJson(message); }
Json ValueJson(const Quantity& quantity) {
  Json json = {{"value", nullptr}, {"unit", quantity.unit}};
  if (std::isfinite(quantity.value)) json["value"] = quantity.value;
  return json;
}
template <class Item>
Json ValueJson(const std::vector<Item>& items) {
  Json json = Json::array();
  for (const Item& item : items) json.push_back(ValueJson(item));
  return json;
}

std::optional<Message> ParsedMessage(const Json& json, std::string_view english, int depth);

std::optional<Value> ParsedObject(const Json& json, int depth) {
  if (json.contains("id")) {
    auto word = ParsedMessage(json, "", depth + 1);
    if (!word || word->empty()) return std::nullopt;
    return Value(std::move(*word));
  }
  const auto unit = json.find("unit");
  const auto value = json.find("value");
  if (unit == json.end() || !unit->is_string() || value == json.end()) return std::nullopt;
  if (!value->is_number() && !value->is_null()) return std::nullopt;
  return Quantity{
      value->is_number() ? value->get<double>() : std::numeric_limits<double>::quiet_NaN(),
      unit->get<std::string>()};
}

std::optional<Value> ParsedArray(const Json& json, int depth) {
  const auto all = [&](auto test) { return std::all_of(json.begin(), json.end(), test); };
  if (all([](const Json& item) { return item.is_number_integer(); }))
    return json.get<std::vector<std::int64_t>>();
  if (all([](const Json& item) { return item.is_string(); }))
    return json.get<std::vector<std::string>>();
  std::vector<Message> words;
  for (const Json& item : json) {
    auto word = ParsedMessage(item, "", depth + 1);
    if (!word || word->empty()) return std::nullopt;
    words.push_back(std::move(*word));
  }
  return words;
}

std::optional<Value> ParsedValue(const Json& json, int depth) {
  if (json.is_string()) return json.get<std::string>();
  if (json.is_number_integer()) return json.get<std::int64_t>();
  if (json.is_object()) return ParsedObject(json, depth);
  if (json.is_array()) return ParsedArray(json, depth);
  return std::nullopt;
}

std::optional<Message> ParsedMessage(const Json& json, std::string_view english, int depth) {
  if (depth > kMaxMessageDepth || !json.is_object()) return std::nullopt;
  const auto id = json.find("id");
  const auto given = json.find("arguments");
  if (id == json.end() || !id->is_string()) return std::nullopt;
  std::vector<MessageArgument> arguments;
  if (given != json.end()) {
    if (!given->is_object()) return std::nullopt;
    for (const auto& [name, value] : given->items()) {
      auto parsed = ParsedValue(value, depth);
      if (!parsed) return std::nullopt;
      arguments.push_back({name, std::move(*parsed)});
    }
  }
  Message message = Message::Stored(id->get<std::string>(), std::move(arguments), english);
  // A word that is not known has no sentence beside it.
  if (english.empty() && message == Message::Verbatim("")) return std::nullopt;
  return message;
}

}  // namespace

Json MessageJson(const Message& message) {
  Json arguments = Json::object();
  for (const MessageArgument& argument : message.arguments())
    arguments[argument.name] =
        std::visit([](const auto& value) { return ValueJson(value); }, argument.value);
  return {{"id", message.id()}, {"arguments", std::move(arguments)}};
}

Json MessagesJson(std::span<const Message> messages) {
  Json json = Json::array();
  for (const Message& message : messages) json.push_back(MessageJson(message));
  return json;
}

Message MessageFromJson(const Json& json, std::string_view english) {
  return ParsedMessage(json, english, 0).value_or(Message::Verbatim(english));
}

std::vector<Message> MessagesFromJson(const Json& messages, std::span<const std::string> english) {
  std::vector<Message> read;
  const bool fits = messages.is_array() && messages.size() == english.size();
  for (std::size_t i = 0; i < english.size(); ++i)
    read.push_back(fits ? MessageFromJson(messages[i], english[i]) : Message::Verbatim(english[i]));
  return read;
}

}  // namespace plumb
