// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/preferred_language.hpp"

#include <algorithm>
#include <charconv>

#include "algo/base/ascii_lower.hpp"

namespace plumb::web {
namespace {

std::string_view Trimmed(std::string_view text) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// The weight of one entry of the header, as "es-MX;q=0.8".
double WeightOf(std::string_view entry) {
  const std::size_t mark = entry.find(";q=");
  if (mark == std::string_view::npos) return 1.0;
  const std::string_view number = Trimmed(entry.substr(mark + 3));
  double weight = 0.0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), weight);
  return error == std::errc{} && end == number.data() + number.size() ? weight : 0.0;
}

/// True for "es", "es-MX" and "ES;q=0.3".
bool Names(std::string_view entry, std::string_view language) {
  if (entry.size() < language.size()) return false;
  const bool begins = std::equal(language.begin(), language.end(), entry.begin(),
                                 [](char a, char b) { return a == AsciiLower(b); });
  const char next = entry.size() == language.size() ? ';' : entry[language.size()];
  return begins && (next == '-' || next == ';' || next == ' ');
}

}  // namespace

const Catalogue& PreferredLanguage(std::string_view accept_language,
                                   std::span<const Catalogue* const> known) {
  const Catalogue* best = known.front();
  double weight = 0.0;
  while (!accept_language.empty()) {
    const std::size_t comma = std::min(accept_language.find(','), accept_language.size());
    const std::string_view entry = Trimmed(accept_language.substr(0, comma));
    accept_language.remove_prefix(std::min(comma + 1, accept_language.size()));
    for (const Catalogue* language : known) {
      if (!Names(entry, language->code) || WeightOf(entry) <= weight) continue;
      best = language;
      weight = WeightOf(entry);
    }
  }
  return *best;
}

}  // namespace plumb::web
