// SPDX-License-Identifier: Apache-2.0
// What a person may read, as an identity with arguments. Texts come from the catalogues of
// web/words, one file for each language; only the English one is needed to report an error.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace plumb {

/// Identity of a message, such as "acceptance.coverage_low". The build makes a constant and a
/// function with typed arguments for each one of web/words/en.json, in plumb::say: for example
/// say::acceptance::kCoverageLow and say::acceptance::CoverageLow() in "words/acceptance.hpp".
struct MessageId {
  std::string_view name;
  friend constexpr bool operator==(const MessageId&, const MessageId&) = default;
};

/// A number that carries its unit, such as 3.2 "mm"; the units are those of web/words/en.json.
/// The unit is empty for a pure number.
struct Quantity {
  double value = 0.0;
  std::string unit;
  friend bool operator==(const Quantity&, const Quantity&) = default;
};

struct MessageArgument;

/// A value; compares equal if id and arguments do.
class Message {
 public:
  /// An empty message, whose text is empty.
  Message() = default;
  /// Used by the functions of plumb::say, which know which arguments an id has.
  Message(MessageId id, std::vector<MessageArgument> arguments);

  /// Text that came from outside or from an older version, in whatever language it is; an empty
  /// message for an empty text.
  [[nodiscard]] static Message Verbatim(std::string_view text);
  /// A message that was stored or sent. An id that this version does not know, or arguments that do
  /// not fit it, give the English sentence that was stored beside it, verbatim.
  [[nodiscard]] static Message Stored(std::string_view id, std::vector<MessageArgument> arguments,
                                      std::string_view english);

  [[nodiscard]] const std::string& id() const { return id_; }
  [[nodiscard]] const std::vector<MessageArgument>& arguments() const { return arguments_; }
  [[nodiscard]] bool empty() const { return id_.empty(); }
  [[nodiscard]] bool Is(MessageId id) const { return id_ == id.name; }

  /// The sentence for logs and for readers that know no ids.
  [[nodiscard]] std::string English() const;

  friend bool operator==(const Message& a, const Message& b);

 private:
  std::string id_;
  std::vector<MessageArgument> arguments_;
};

/// An argument and its name. A word that depends on the language, such as a direction or a part of
/// the body, is a message without arguments.
struct MessageArgument {
  using Value =
      std::variant<std::string, std::int64_t, Quantity, Message, std::vector<std::int64_t>,
                   std::vector<std::string>, std::vector<Message>>;
  std::string name;
  Value value;
};

/// The texts of one language, made from its file in web/words.
struct Catalogue {
  std::string_view code;    ///< Such as "en"; the name of the file.
  std::string_view name;    ///< Of the language, in itself.
  std::string_view locale;  ///< Such as "en-GB".
  char decimal;             ///< Sign between whole numbers and decimals.
  bool zero_is_singular;    ///< Plural forms: "one" for 0 too, as in French.
  std::span<const std::pair<std::string_view, std::string_view>> texts;  ///< Sorted by id.

  [[nodiscard]] std::optional<std::string_view> TextOf(std::string_view id) const;
};

[[nodiscard]] const Catalogue& EnglishCatalogue();
/// Every language, English first. Only programs that show texts to people link them.
[[nodiscard]] std::span<const Catalogue* const> Catalogues();
/// nullptr if there is no such language.
[[nodiscard]] const Catalogue* FindCatalogue(std::string_view code);

/// The message in the language of the catalogue.
[[nodiscard]] std::string Text(const Message& message, const Catalogue& catalogue);
[[nodiscard]] std::vector<std::string> Texts(std::span<const Message> messages,
                                             const Catalogue& catalogue);
[[nodiscard]] std::vector<std::string> EnglishTexts(std::span<const Message> messages);

}  // namespace plumb
