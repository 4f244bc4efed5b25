// SPDX-License-Identifier: Apache-2.0
#include "algo/base/message.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"

namespace plumb {
namespace {

// A language of its own, so that the texts of the product can change.
constexpr std::pair<std::string_view, std::string_view> kTestTexts[] = {
    {"test.ids", "Marker {ids:ints}"},
    {"test.left", "links"},
    {"test.moved", "{n:int, plural, one {# Scan} other {# Scans}} ({where:words})"},
    {"test.rise", "um {rise:mm+.1}, {rise:mm.0!} von {limit:number}"},
    {"test.scan", "{scan:words, select, left {im linken {tilt:deg.2}} other {anderswo}}"},
    {"unit.deg", "{value}°"},
    {"unit.mm", "{value} mm"},
};
constexpr Catalogue kTest = {"xx", "Test", "xx-XX", ',', false, kTestTexts};

const Message kLeft(MessageId{"test.left"}, {});

TEST(MessageTest, NumbersGetUnitSignAndDecimalSignOfTheLanguage) {
  const Message rise(MessageId{"test.rise"},
                     {{"rise", Quantity{1234.56, "mm"}}, {"limit", Quantity{0.25, ""}}});
  EXPECT_EQ(Text(rise, kTest), "um +1234,6 mm, 1235 von 0,25");
}

TEST(MessageTest, CountsChooseThePluralForm) {
  const auto moved = [](std::int64_t n) {
    return Message(MessageId{"test.moved"}, {{"n", n}, {"where", kLeft}});
  };
  EXPECT_EQ(Text(moved(1), kTest), "1 Scan (links)");
  EXPECT_EQ(Text(moved(2), kTest), "2 Scans (links)");
  EXPECT_EQ(Text(moved(0), kTest), "0 Scans (links)");
  Catalogue zero = kTest;
  zero.zero_is_singular = true;
  EXPECT_EQ(Text(moved(0), zero), "0 Scan (links)");
}

TEST(MessageTest, WordsChooseACaseThatMayHoldArguments) {
  const Message here(MessageId{"test.scan"}, {{"scan", kLeft}, {"tilt", Quantity{0.5, "deg"}}});
  EXPECT_EQ(Text(here, kTest), "im linken 0,50°");
  const Message there(MessageId{"test.scan"},
                      {{"scan", Message(MessageId{"test.right"}, {})}, {"tilt", Quantity{}}});
  EXPECT_EQ(Text(there, kTest), "anderswo");
}

TEST(MessageTest, ListsAreJoined) {
  const Message ids(MessageId{"test.ids"}, {{"ids", std::vector<std::int64_t>{3, 7}}});
  EXPECT_EQ(Text(ids, kTest), "Marker 3, 7");
}

TEST(MessageTest, VerbatimTextIsItselfInEachLanguage) {
  const Message text = Message::Verbatim("a {brace} and # stay");
  for (const Catalogue* catalogue : Catalogues())
    EXPECT_EQ(Text(text, *catalogue), "a {brace} and # stay");
  EXPECT_EQ(Message().English(), "");
}

TEST(MessageTest, JsonGivesTheSameMessageBack) {
  const Message nested = Message::Verbatim("inner");
  const Message outer(MessageId{"text.verbatim"}, {{"text", std::string("1,5 %")}});
  EXPECT_EQ(MessageFromJson(MessageJson(outer), "unused"), outer);
  EXPECT_EQ(MessageJson(outer).dump(), R"({"id":"text.verbatim","arguments":{"text":"1,5 %"}})");
  const std::vector<Message> both = {nested, outer};
  EXPECT_EQ(MessagesFromJson(MessagesJson(both), EnglishTexts(both)), both);
}

TEST(MessageTest, WhatDoesNotFitThisVersionIsTheEnglishBesideIt) {
  using Json = nlohmann::ordered_json;
  const Message english = Message::Verbatim("as it was");
  for (const char* text :
       {R"({"id": "future.id", "arguments": {}})", R"({"id": "text.verbatim", "arguments": {}})",
        R"({"id": "text.verbatim", "arguments": {"text": 3}})",
        R"({"id": "text.verbatim", "arguments": {"text": "a", "more": "b"}})",
        R"({"id": "text.verbatim", "arguments": {"text": {"id": "future.word"}}})", R"({"id": 7})",
        R"([])", R"(null)"}) {
    EXPECT_EQ(MessageFromJson(Json::parse(text), "as it was"), english) << text;
  }
  const std::vector<std::string> sentences = {"one", "two"};
  const std::vector<Message> old = {Message::Verbatim("one"), Message::Verbatim("two")};
  EXPECT_EQ(MessagesFromJson(Json(), sentences), old);
  EXPECT_EQ(MessagesFromJson(Json::array({1}), sentences), old);
}

/// A placeholder of a text: NAME:TYPE, and the cases if it is a select.
struct Placeholder {
  std::string name, type;
  std::vector<std::string> cases;
};

/// Length of the group in braces that the text begins with.
std::size_t GroupLength(std::string_view text) {
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    depth += text[i] == '{' ? 1 : text[i] == '}' ? -1 : 0;
    if (depth == 0) return i + 1;
  }
  return text.size();
}

/// Those of a text, also those within cases.
std::vector<Placeholder> PlaceholdersOf(std::string_view text) {
  std::vector<Placeholder> found;
  for (std::size_t open = text.find('{'); open != std::string_view::npos; open = text.find('{')) {
    const std::size_t length = GroupLength(text.substr(open));
    const std::string_view inside = text.substr(open + 1, length - 2);
    text.remove_prefix(open + length);
    const std::size_t comma = inside.find(',');
    const std::string_view head = inside.substr(0, comma);
    const std::size_t colon = head.find(':');
    Placeholder one = {.name = std::string(head.substr(0, colon)),
                       .type = std::string(head.substr(colon + 1)),
                       .cases = {}};
    std::string_view cases = comma == std::string_view::npos ? "" : inside.substr(comma + 2);
    std::vector<Placeholder> within;
    const bool is_select = cases.starts_with("select, ");
    cases.remove_prefix(std::min(cases.size(), std::string_view("select, ").size()));
    while (cases.find('{') != std::string_view::npos) {
      const std::size_t begin = cases.find('{');
      const std::size_t size = GroupLength(cases.substr(begin));
      std::string_view name = cases.substr(0, begin - 1);
      while (name.starts_with(' ')) name.remove_prefix(1);
      if (is_select && name != "other") one.cases.emplace_back(name);
      for (Placeholder& inner : PlaceholdersOf(cases.substr(begin + 1, size - 2)))
        within.push_back(std::move(inner));
      cases.remove_prefix(begin + size);
    }
    // What chooses comes first: a case may name it again.
    found.push_back(std::move(one));
    for (Placeholder& inner : within) found.push_back(std::move(inner));
  }
  return found;
}

/// A message of the catalogue that chooses this case.
Message WordFor(const std::string& wanted) {
  for (const auto& [id, text] : EnglishCatalogue().texts) {
    if (id.substr(id.rfind('.') + 1) == wanted && text.find('{') == std::string_view::npos)
      return {MessageId{id}, {}};
  }
  ADD_FAILURE() << "no word chooses the case " << wanted;
  return Message::Verbatim(wanted);
}

/// @param round  The values differ from one to the next: numbers, signs, lengths, cases.
MessageArgument::Value SampleOf(const Placeholder& placeholder, std::size_t round) {
  const std::string base = placeholder.type.substr(0, placeholder.type.find_first_of("+.!"));
  const std::string chosen = round < placeholder.cases.size() ? placeholder.cases[round] : "";
  const Message word = Message::Verbatim("word #1");
  if (base == "text") return chosen.empty() ? "<" + placeholder.name + " #1>" : chosen;
  if (base == "int") {
    static constexpr std::int64_t kCounts[] = {0, 1, 2, 1234567};
    return chosen.empty() ? kCounts[round % 4] : std::int64_t{std::stoll(chosen)};
  }
  if (base == "words") return chosen.empty() ? word : WordFor(chosen);
  if (base == "ints") return std::vector<std::int64_t>(round % 3, 7);
  if (base == "texts") return std::vector<std::string>(round % 3, "name");
  if (base == "list") return std::vector<Message>(round % 3, word);
  static constexpr double kNumbers[] = {0.0,  -1.25,   0.125,  2.5,      1234567.891, -0.04,
                                        1e-7, 99.9995, 0.0625, 123456.5, -3.0,        1.0 / 3.0};
  return Quantity{kNumbers[round % std::size(kNumbers)], base == "number" ? "" : base};
}

/// Every text with arguments of every kind. Where PLUMB_SAID names a file, all is written there,
/// for the page's own writer (tests/web/catalogue_test.mjs) to be compared with.
TEST(MessageTest, EveryTextOfEveryLanguageIsWritten) {
  const char* const file = std::getenv("PLUMB_SAID");
  std::ofstream out(file == nullptr ? "/dev/null" : file);
  for (const Catalogue* catalogue : Catalogues()) {
    for (const auto& [id, text] : catalogue->texts) {
      if (id.starts_with("unit.")) continue;
      const std::vector<Placeholder> placeholders = PlaceholdersOf(text);
      for (std::size_t round = 0; round < (placeholders.empty() ? 1 : 12); ++round) {
        std::vector<MessageArgument> arguments;
        for (const Placeholder& one : placeholders) {
          const bool is_new =
              std::none_of(arguments.begin(), arguments.end(),
                           [&](const MessageArgument& other) { return other.name == one.name; });
          if (is_new) arguments.push_back({one.name, SampleOf(one, round)});
        }
        const Message message(MessageId{id}, std::move(arguments));
        const std::string said = Text(message, *catalogue);
        EXPECT_EQ(said.find_first_of("{}"), std::string::npos) << catalogue->code << ": " << said;
        EXPECT_TRUE(said.find('?') == std::string::npos || text.find('?') != std::string::npos)
            << catalogue->code << ": " << said;
        EXPECT_EQ(MessageFromJson(MessageJson(message), "lost"), message) << id;
        const nlohmann::ordered_json line = {
            {"language", catalogue->code}, {"message", MessageJson(message)}, {"text", said}};
        out << line.dump() << '\n';
      }
    }
  }
}

TEST(MessageTest, AnErrorCarriesItsMessage) {
  const DataError error(Message::Verbatim("cannot read it"));
  EXPECT_STREQ(error.what(), "cannot read it");
  EXPECT_EQ(MessageOf(error), Message::Verbatim("cannot read it"));
  EXPECT_EQ(MessageOf(std::runtime_error("other")), Message::Verbatim("other"));
}

}  // namespace
}  // namespace plumb
