// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/language.hpp"

#include <cstdlib>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/base/utf8.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

bool BeginsCharacter(char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) != 0x80U; }

std::string SpacesFor(std::string_view text, std::size_t characters) {
  const std::size_t has = Utf8Characters(text);
  return std::string(has < characters ? characters - has : 0, ' ');
}

}  // namespace

Message UnknownLanguage(std::string_view code) {
  std::vector<std::string> known;
  for (const Catalogue* one : Catalogues())
    known.push_back(fmt::format("{} ({})", one->code, one->name));
  return say::cli::UnknownLanguage(code, std::move(known));
}

std::string LanguageCodes() {
  std::vector<std::string_view> codes;
  for (const Catalogue* one : Catalogues()) codes.push_back(one->code);
  return fmt::format("{}", fmt::join(codes, ", "));
}

const Catalogue& LanguageOfEnvironment() {
  for (const char* name : {"LC_ALL", "LC_MESSAGES", "LANG"}) {
    const char* const value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    const std::string_view locale(value);
    const Catalogue* const found = FindCatalogue(locale.substr(0, locale.find_first_of("_.@")));
    return found != nullptr ? *found : EnglishCatalogue();
  }
  return EnglishCatalogue();
}

std::string LeftAligned(std::string_view text, std::size_t characters) {
  return std::string(text) + SpacesFor(text, characters);
}

std::string RightAligned(std::string_view text, std::size_t characters) {
  return SpacesFor(text, characters) + std::string(text);
}

std::string_view FirstCharacters(std::string_view text, std::size_t characters) {
  std::size_t end = 0;
  for (; end < text.size(); ++end) {
    if (BeginsCharacter(text[end]) && characters-- == 0) break;
  }
  return text.substr(0, end);
}

}  // namespace plumb
