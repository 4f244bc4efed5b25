// SPDX-License-Identifier: Apache-2.0
// Section [directory] of the configuration: the clinic's directory (LDAP), which knows people's
// passwords and groups.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/config_section.hpp"

namespace plumb {

/// Stand in the settings for the name that was typed and for the person's entry.
inline constexpr std::string_view kPlaceOfName = "{name}", kPlaceOfPerson = "{person}";

/// Without a url there is no directory.
struct DirectorySettings {
  /// "ldaps://HOST:PORT", "ldap://HOST:PORT", which begins TLS before anything is sent, or
  /// "ldapi://SOCKET" with %2F for each slash.
  std::string url;
  std::filesystem::path trusted;  ///< Certificates, PEM; empty: those of the system.
  /// The name with which a person logs in there; {name} stands for what was typed.
  std::string person;
  /// Where to look for the person's entry after that, and by which filter with {name}. Empty:
  /// `person` is the entry itself.
  std::string people_base;
  std::string people_filter;
  std::string groups_base;
  /// Of the person's groups; {person} stands for the person's entry, {name} for the name.
  std::string groups_filter = "(member={person})";
  std::vector<std::string> engineers;  ///< Groups, as distinguished names; so are the others.
  std::vector<std::string> physicists;
  std::vector<std::string> technicians;

  bool operator==(const DirectorySettings&) const = default;
};

/// @throws DataError naming the key; also for keys that do not fit together.
[[nodiscard]] DirectorySettings ReadDirectorySettings(Section section);

}  // namespace plumb
