// SPDX-License-Identifier: Apache-2.0
#include "web/http/router.hpp"

#include <algorithm>

#include "web/http/checks.hpp"

namespace plumb::web {
namespace {

std::string_view TakeSegment(std::string_view& path) {
  const auto slash = path.find('/');
  const std::string_view segment = path.substr(0, slash);
  path = slash == std::string_view::npos ? std::string_view() : path.substr(slash + 1);
  return segment;
}

bool Matches(std::string_view pattern, std::string_view path, std::vector<std::string>& arguments) {
  if (path.empty() || path.front() != '/') return false;
  if (std::count(pattern.begin(), pattern.end(), '/') != std::count(path.begin(), path.end(), '/'))
    return false;
  pattern.remove_prefix(1);
  path.remove_prefix(1);
  while (!pattern.empty()) {
    const std::string_view expected = TakeSegment(pattern), found = TakeSegment(path);
    if (expected.starts_with('{')) {
      if (!IsName(found)) return false;
      arguments.emplace_back(found);
    } else if (expected != found) {
      return false;
    }
  }
  return path.empty();
}

}  // namespace

Router::Match Router::Find(std::string_view method, std::string_view path) const {
  Match match;
  for (const Route& route : routes_) {
    std::vector<std::string> arguments;
    if (!Matches(route.pattern, path, arguments)) continue;
    if (!match.allowed.empty()) match.allowed += ", ";
    match.allowed += route.method;
    if (route.method == method && match.route == nullptr) {
      match.route = &route;
      match.arguments = std::move(arguments);
    }
  }
  return match;
}

}  // namespace plumb::web
