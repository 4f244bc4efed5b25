// The page's files as embedded in the program.
#pragma once

#include <span>
#include <string_view>

namespace plumb::web {

struct Asset {
  std::string_view path;  ///< "/assets/app.1a2b3c4d.js" or "/".
  std::string_view type;
  std::string_view plain;
  std::string_view gzip;  ///< The same, compressed.
  bool hashed = false;    ///< The name changes with the content, so it may be cached for ever.
};

[[nodiscard]] std::span<const Asset> Assets();
/// Null if there is none.
[[nodiscard]] const Asset* FindAsset(std::string_view path);

/// Spanish translations of the appliance's texts, from `assets/strings/es_appliance.js`: phrases,
/// and patterns (ECMAScript regular expressions) whose translations name their groups "$1" to "$9".
struct Phrase {
  std::string_view text, words;
};
[[nodiscard]] std::span<const Phrase> SpanishPhrases();
[[nodiscard]] std::span<const Phrase> SpanishPatterns();

}  // namespace plumb::web
