// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/directory_settings.hpp"

#include <algorithm>
#include <cctype>
#include <utility>

namespace plumb {
namespace {

constexpr std::size_t kMostGroups = 32;  // Of each role.

// Scheme and host only: a path, a filter or a name of a user has no place there.
bool IsDirectoryUrl(const std::string& text) {
  const auto is_of_host = [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view(".-_:[]%").find(static_cast<char>(c)) != std::string_view::npos;
  };
  for (const std::string_view scheme : {"ldaps://", "ldap://", "ldapi://"})
    if (text.starts_with(scheme) && text.size() > scheme.size() && text.size() < 256)
      return std::all_of(text.begin() + static_cast<std::ptrdiff_t>(scheme.size()), text.end(),
                         is_of_host);
  return false;
}

bool IsShortText(const std::string& text) { return !text.empty() && text.size() < 1024; }

bool HasName(const std::string& text) {
  return IsShortText(text) && text.find(kPlaceOfName) != std::string::npos;
}

bool HasPerson(const std::string& text) { return text.find(kPlaceOfPerson) != std::string::npos; }

// Begins with an attribute and its value, at least.
bool IsDistinguishedName(const std::string& text) {
  const std::size_t at = text.find('=');
  return at != std::string::npos && at > 0;
}

bool IsFilter(const std::string& text) {
  return IsShortText(text) && text.front() == '(' && text.back() == ')';
}

}  // namespace

DirectorySettings ReadDirectorySettings(Section section) {
  DirectorySettings settings;
  section.Take("url", settings.url, say::config::ExpectedDirectoryUrl(), IsDirectoryUrl);
  section.TakePath("trusted", settings.trusted);
  section.Take("person", settings.person,
               say::config::ExpectedPlaceOfName(std::string(kPlaceOfName)), HasName);
  section.Take("people_base", settings.people_base, say::config::ExpectedEntry(), IsShortText);
  section.Take("people_filter", settings.people_filter,
               say::config::ExpectedPersonFilter(std::string(kPlaceOfName)),
               [](const std::string& text) { return IsFilter(text) && HasName(text); });
  section.Take("groups_base", settings.groups_base, say::config::ExpectedEntry(), IsShortText);
  // Without the person in it all groups would be everybody's.
  section.Take(
      "groups_filter", settings.groups_filter,
      say::config::ExpectedFilter(std::string(kPlaceOfPerson)),
      [](const std::string& text) { return IsFilter(text) && (HasName(text) || HasPerson(text)); });
  // A short name would be no group of anybody's.
  for (const auto& [key, names] :
       {std::pair("engineers", &settings.engineers), std::pair("physicists", &settings.physicists),
        std::pair("technicians", &settings.technicians)})
    section.TakeNames(key, *names, say::config::ExpectedGroups(), kMostGroups, IsDistinguishedName);
  section.RejectUnknownKeys();
  if (settings.url.empty()) return settings;
  const bool has_groups =
      !settings.engineers.empty() || !settings.physicists.empty() || !settings.technicians.empty();
  if (settings.person.empty() || settings.groups_base.empty() || !has_groups)
    throw DataError(say::config::DirectoryIncomplete());
  if (settings.people_base.empty() != settings.people_filter.empty())
    throw DataError(say::config::DirectoryPeopleIncomplete());
  // The name by which a person logs in is no member of a group, unless it is that of an entry.
  if (settings.people_filter.empty() && HasPerson(settings.groups_filter) &&
      !IsDistinguishedName(settings.person))
    throw DataError(say::config::DirectoryPersonIsNoEntry(std::string(kPlaceOfPerson)));
  return settings;
}

}  // namespace plumb
