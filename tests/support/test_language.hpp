// SPDX-License-Identifier: Apache-2.0
// A language for tests: a decimal comma, and each text is its id in angle brackets, but for some.
#pragma once

#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"

namespace plumb::test {

/// Every text of the English catalogue is there, so that an English word in a report of this
/// language did not come from a catalogue.
inline const Catalogue& TestLanguage() {
  static const auto* const kTexts = [] {
    static std::deque<std::string> kept;
    auto* texts = new std::vector<std::pair<std::string_view, std::string_view>>;
    for (const auto& [id, english] : EnglishCatalogue().texts) {
      std::string text = "<" + std::string(id);
      // The placeholders stay, in their order.
      for (std::size_t at = english.find('{'); at != std::string_view::npos;) {
        std::size_t end = at, depth = 0;
        do {
          if (english[end] == '{') ++depth;
          if (english[end] == '}') --depth;
          ++end;
        } while (depth > 0);
        text += " " + std::string(english.substr(at, end - at));
        at = english.find('{', end);
      }
      const bool is_unit = id.starts_with("unit.") || id == "text.verbatim";
      kept.push_back(is_unit ? std::string(english) : text + ">");
      texts->emplace_back(id, kept.back());
    }
    return texts;
  }();
  static const Catalogue kLanguage{"xx", "Test", "xx-XX", ',', false, *kTexts};
  return kLanguage;
}

}  // namespace plumb::test
