// The page's files as the build put them into the program.
#pragma once

#include <span>
#include <string_view>

namespace plumb::web {

struct Asset {
  std::string_view path;  ///< "/assets/app.1a2b3c4d.js" or "/".
  std::string_view type;
  std::string_view plain;
  std::string_view gzip;  ///< The same, compressed.
  bool hashed = false;    ///< The name changes with the content: may be cached for ever.
};

[[nodiscard]] std::span<const Asset> Assets();
/// Null if there is none.
[[nodiscard]] const Asset* FindAsset(std::string_view path);

/// Words of the appliance in Spanish, from `assets/strings/es_appliance.js`: phrases, and patterns
/// (regular expressions of ECMAScript) whose words name their groups "$1" to "$9".
struct Phrase {
  std::string_view text, words;
};
[[nodiscard]] std::span<const Phrase> SpanishPhrases();
[[nodiscard]] std::span<const Phrase> SpanishPatterns();

}  // namespace plumb::web
