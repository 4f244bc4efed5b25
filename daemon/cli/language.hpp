// SPDX-License-Identifier: Apache-2.0
// The language in which the commands talk to people.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "algo/base/message.hpp"

namespace plumb {

/// The message for an unknown language; it lists the known ones.
[[nodiscard]] Message UnknownLanguage(std::string_view code);

/// "de, en, ...": every code that `--language` takes.
[[nodiscard]] std::string LanguageCodes();

/// The language that LC_ALL, LC_MESSAGES and LANG ask for; as with other programs, the first that
/// is set decides. English where it is none of the catalogues'.
[[nodiscard]] const Catalogue& LanguageOfEnvironment();

/// With spaces behind it, or before it, up to that many characters. A longer text stays as it is.
[[nodiscard]] std::string LeftAligned(std::string_view text, std::size_t characters);
[[nodiscard]] std::string RightAligned(std::string_view text, std::size_t characters);

/// Its first characters, that many at most.
[[nodiscard]] std::string_view FirstCharacters(std::string_view text, std::size_t characters);

}  // namespace plumb
