// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/config_section.hpp"

namespace plumb {
namespace {

/// TOML has no control characters except tab and line ends. A file that lost its content in a power
/// cut is often full of zero bytes.
bool IsControl(char c) {
  return (static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\n' && c != '\r') || c == 0x7f;
}

void RefuseControlCharacters(const std::string& text, const std::string& name) {
  std::int64_t line = 1;
  for (const char c : text) {
    line += c == '\n' ? 1 : 0;
    if (IsControl(c))
      throw DataError(say::config::ControlCharacter(name, line, static_cast<unsigned char>(c)));
  }
}

}  // namespace

toml::table ParseToml(const std::string& text, const std::string& name) try {
  RefuseControlCharacters(text, name);
  return toml::parse(text, name);
} catch (const toml::parse_error& error) {
  throw DataError(say::config::NotToml(name, error.source().begin.line, error.description()));
}

}  // namespace plumb
