// SPDX-License-Identifier: Apache-2.0
#include "algo/base/message.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace plumb {
namespace {

using Value = MessageArgument::Value;

constexpr std::string_view kVerbatimId = "text.verbatim";

const Value* ArgumentOf(const Message& message, std::string_view name) {
  const auto& arguments = message.arguments();
  const auto found =
      std::find_if(arguments.begin(), arguments.end(),
                   [&](const MessageArgument& argument) { return argument.name == name; });
  return found == arguments.end() ? nullptr : &found->value;
}

/// The catalogues' texts are checked by the build (web/words/generate.py), so a text that does not
/// parse is a fault of this program.
class MessageWriter {
 public:
  MessageWriter(const Message& message, const Catalogue& catalogue)
      : message_(message), catalogue_(catalogue) {}

  std::string Written(std::string_view text) const { return Written(text, ""); }

 private:
  /// @param count  What "#" stands for.
  std::string Written(std::string_view text, std::string_view count) const {
    std::string written;
    while (!text.empty()) {
      const std::size_t next = text.find_first_of(count.empty() ? "{" : "{#");
      written += text.substr(0, next);
      if (next == std::string_view::npos) break;
      if (text[next] == '#') {
        written += count;
        text.remove_prefix(next + 1);
        continue;
      }
      const std::size_t length = Group(text.substr(next));
      written += Placeholder(text.substr(next + 1, length - 2));
      text.remove_prefix(next + length);
    }
    return written;
  }

  /// Length of the group in braces that the text begins with.
  static std::size_t Group(std::string_view text) {
    int depth = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (text[i] == '{') ++depth;
      if (text[i] == '}' && --depth == 0) return i + 1;
    }
    throw std::logic_error(fmt::format("unbalanced braces in a text: {}", text));
  }

  /// NAME:TYPE, or NAME:TYPE, plural or select, and the cases.
  std::string Placeholder(std::string_view inside) const {
    const std::size_t comma = inside.find(',');
    const std::string_view head = inside.substr(0, comma);
    const std::size_t colon = head.find(':');
    const Value* value = ArgumentOf(message_, head.substr(0, colon));
    if (value == nullptr) return "?";
    const std::string_view type = head.substr(std::min(colon, head.size() - 1) + 1);
    if (comma == std::string_view::npos) return Formatted(*value, type);
    return Chosen(*value, type, inside.substr(comma + 1));
  }

  std::string Chosen(const Value& value, std::string_view type, std::string_view cases) const {
    const bool is_plural =
        cases.find("plural,") != std::string_view::npos && cases.find("plural,") < cases.find('{');
    const std::string shown = Formatted(value, type);
    const std::string key = is_plural ? PluralOf(value) : KeyOf(value);
    cases.remove_prefix(cases.find(',') + 1);
    std::string_view chosen;
    for (std::size_t open = cases.find('{'); open != std::string_view::npos;
         open = cases.find('{')) {
      std::string_view name = cases.substr(0, open);
      name.remove_prefix(std::min(name.find_first_not_of(' '), name.size()));
      name = name.substr(0, name.find(' '));
      const std::size_t length = Group(cases.substr(open));
      const std::string_view text = cases.substr(open + 1, length - 2);
      cases.remove_prefix(open + length);
      if (name == "other" && chosen.data() == nullptr) chosen = text;
      if (name == key) {
        chosen = text;
        break;
      }
    }
    return Written(chosen, is_plural ? shown : "");
  }

  std::string PluralOf(const Value& value) const {
    const auto* count = std::get_if<std::int64_t>(&value);
    const bool is_one =
        count != nullptr && (*count == 1 || (*count == 0 && catalogue_.zero_is_singular));
    return is_one ? "one" : "other";
  }

  static std::string KeyOf(const Value& value) {
    if (const auto* text = std::get_if<std::string>(&value)) return *text;
    if (const auto* word = std::get_if<Message>(&value))
      return word->id().substr(word->id().rfind('.') + 1);
    if (const auto* number = std::get_if<std::int64_t>(&value)) return std::to_string(*number);
    return "";
  }

  std::string Formatted(const Value& value, std::string_view type) const {
    const auto each = [](const auto& list, const auto& text) {
      std::string joined;
      for (const auto& item : list) joined += (joined.empty() ? "" : ", ") + text(item);
      return joined;
    };
    const auto said = [&](const Message& word) { return Text(word, catalogue_); };
    if (const auto* text = std::get_if<std::string>(&value)) return *text;
    if (const auto* number = std::get_if<std::int64_t>(&value)) return std::to_string(*number);
    if (const auto* word = std::get_if<Message>(&value)) return said(*word);
    if (const auto* ids = std::get_if<std::vector<std::int64_t>>(&value))
      return each(*ids, [](std::int64_t id) { return std::to_string(id); });
    if (const auto* texts = std::get_if<std::vector<std::string>>(&value))
      return each(*texts, [](const std::string& text) { return text; });
    if (const auto* words = std::get_if<std::vector<Message>>(&value)) return each(*words, said);
    return FormattedQuantity(std::get<Quantity>(value), type);
  }

  /// UNIT[+][.DECIMALS][!]: with its sign, with fixed decimals, without the unit.
  std::string FormattedQuantity(const Quantity& quantity, std::string_view type) const {
    const bool is_signed = type.find('+') != std::string_view::npos;
    const std::size_t point = type.find('.');
    std::string number;
    if (point == std::string_view::npos) {
      number =
          is_signed ? fmt::format("{:+g}", quantity.value) : fmt::format("{:g}", quantity.value);
    } else {
      const int decimals = type[point + 1] - '0';
      number = is_signed ? fmt::format("{:+.{}f}", quantity.value, decimals)
                         : fmt::format("{:.{}f}", quantity.value, decimals);
    }
    std::replace(number.begin(), number.end(), '.', catalogue_.decimal);
    if (quantity.unit.empty() || type.find('!') != std::string_view::npos) return number;
    const auto pattern = catalogue_.TextOf("unit." + quantity.unit);
    if (!pattern) return number + " " + quantity.unit;
    std::string with_unit(*pattern);
    const std::size_t place = with_unit.find("{value}");
    return place == std::string::npos ? number + " " + with_unit
                                      : with_unit.replace(place, 7, number);
  }

  const Message& message_;
  const Catalogue& catalogue_;
};

/// Index of a value's type as the catalogue names it; see generate.py.
bool FitsType(const Value& value, std::string_view type) {
  type = type.substr(0, type.find_first_of("+.!,"));
  if (type == "text") return std::holds_alternative<std::string>(value);
  if (type == "int") return std::holds_alternative<std::int64_t>(value);
  if (type == "words") return std::holds_alternative<Message>(value);
  if (type == "ints") return std::holds_alternative<std::vector<std::int64_t>>(value);
  if (type == "texts") return std::holds_alternative<std::vector<std::string>>(value);
  if (type == "list") return std::holds_alternative<std::vector<Message>>(value);
  const auto* quantity = std::get_if<Quantity>(&value);
  return quantity != nullptr && quantity->unit == (type == "number" ? "" : type);
}

/// True if the arguments are just those of the text's placeholders, with their types. An empty list
/// has lost its type when it was stored, so it fits each list.
bool FitsText(std::string_view text, std::vector<MessageArgument>& arguments) {
  std::vector<std::string_view> used;
  for (std::size_t open = text.find('{'); open != std::string_view::npos;
       open = text.find('{', open + 1)) {
    const std::size_t end = text.find_first_of(",}", open);
    const std::size_t colon = text.find(':', open);
    // The braces of a case hold text, not NAME:TYPE.
    if (colon == std::string_view::npos || colon > end) continue;
    const std::string_view name = text.substr(open + 1, colon - open - 1);
    if (name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_0123456789") != std::string_view::npos)
      continue;
    const std::string_view type = text.substr(colon + 1, end - colon - 1);
    if (type.find(' ') != std::string_view::npos) continue;
    const auto found = std::find_if(arguments.begin(), arguments.end(),
                                    [&](const auto& argument) { return argument.name == name; });
    if (found == arguments.end()) return false;
    const auto* empty = std::get_if<std::vector<std::int64_t>>(&found->value);
    if (empty != nullptr && empty->empty() && type == "texts")
      found->value = std::vector<std::string>();
    if (empty != nullptr && empty->empty() && type == "list") found->value = std::vector<Message>();
    if (!FitsType(found->value, type)) return false;
    if (std::find(used.begin(), used.end(), name) == used.end()) used.push_back(name);
  }
  return used.size() == arguments.size();
}

}  // namespace

Message::Message(MessageId id, std::vector<MessageArgument> arguments)
    : id_(id.name), arguments_(std::move(arguments)) {}

Message Message::Verbatim(std::string_view text) {
  if (text.empty()) return {};
  return {MessageId{kVerbatimId}, {{"text", std::string(text)}}};
}

Message Message::Stored(std::string_view id, std::vector<MessageArgument> arguments,
                        std::string_view english) {
  const auto text = EnglishCatalogue().TextOf(id);
  if (!text || !FitsText(*text, arguments)) return Verbatim(english);
  return {MessageId{id}, std::move(arguments)};
}

std::string Message::English() const { return Text(*this, EnglishCatalogue()); }

bool operator==(const Message& a, const Message& b) {
  const auto same = [](const MessageArgument& x, const MessageArgument& y) {
    return x.name == y.name && x.value == y.value;
  };
  return a.id_ == b.id_ && std::equal(a.arguments_.begin(), a.arguments_.end(),
                                      b.arguments_.begin(), b.arguments_.end(), same);
}

std::optional<std::string_view> Catalogue::TextOf(std::string_view id) const {
  const auto found = std::lower_bound(
      texts.begin(), texts.end(), id,
      [](const auto& entry, std::string_view wanted) { return entry.first < wanted; });
  if (found == texts.end() || found->first != id) return std::nullopt;
  return found->second;
}

std::string Text(const Message& message, const Catalogue& catalogue) {
  if (message.empty()) return "";
  const auto text = catalogue.TextOf(message.id());
  if (!text) return message.id();
  return MessageWriter(message, catalogue).Written(*text);
}

std::vector<std::string> Texts(std::span<const Message> messages, const Catalogue& catalogue) {
  std::vector<std::string> texts;
  texts.reserve(messages.size());
  for (const Message& message : messages) texts.push_back(Text(message, catalogue));
  return texts;
}

std::vector<std::string> EnglishTexts(std::span<const Message> messages) {
  return Texts(messages, EnglishCatalogue());
}

}  // namespace plumb
