#include "web/assets/spanish.hpp"

#include <algorithm>
#include <regex>
#include <string_view>
#include <utility>
#include <vector>

#include "web/assets/assets.hpp"

namespace plumb::web {
namespace {

/// A reason is one sentence; longer texts are not translated, because the library's search
/// recurses.
constexpr std::size_t kMaxText = 400;

using Patterns = std::vector<std::pair<std::regex, std::string_view>>;
const Patterns& Compiled() {
  static const Patterns patterns = [] {
    Patterns made;
    for (const Phrase& phrase : SpanishPatterns())
      made.emplace_back(std::regex(std::string(phrase.text)), phrase.words);
    return made;
  }();
  return patterns;
}

}  // namespace

std::optional<std::string> InSpanish(const std::string& text) {
  if (text.empty() || text.size() > kMaxText) return std::nullopt;
  const auto phrases = SpanishPhrases();
  const auto found = std::find_if(phrases.begin(), phrases.end(),
                                  [&](const Phrase& phrase) { return phrase.text == text; });
  if (found != phrases.end()) return std::string(found->words);
  static const std::regex number(R"(^[+-]?\d+\.\d+$)");
  if (std::regex_match(text, number)) {
    std::string comma = text;
    std::replace(comma.begin(), comma.end(), '.', ',');
    return comma;
  }
  for (const auto& [pattern, words] : Compiled()) {
    std::smatch match;
    if (!std::regex_match(text, match, pattern)) continue;
    std::string said;
    for (std::size_t i = 0; i < words.size(); ++i) {
      if (words[i] != '$' || i + 1 == words.size()) {
        said += words[i];
        continue;
      }
      const std::string part = match.str(static_cast<std::size_t>(words[++i] - '0'));
      said += InSpanish(part).value_or(part);
    }
    return said;
  }
  return std::nullopt;
}

}  // namespace plumb::web
