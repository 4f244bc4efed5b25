// The table of routes: handler and permission of each.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "web/http/message.hpp"
#include "web/security/permissions.hpp"

namespace plumb::web {

enum class BodyKind {
  kNone,
  kJson,
  kForm,
  kFile,  ///< Written directly to the disk: Request::upload.
};

struct Route {
  std::string method;
  std::string pattern;  ///< "/api/v1/scans/{id}"; a placeholder is a whole segment.
  Permission permission = Permission::kView;
  BodyKind body = BodyKind::kNone;
  Handler handler;

  [[nodiscard]] std::string Name() const { return method + " " + pattern; }
};

/// The table; filled once and only read afterwards.
class Router {
 public:
  void Add(Route route) { routes_.push_back(std::move(route)); }
  /// Replaces the handler of each present route by the one that `wrap` makes from it.
  void Wrap(const std::function<Handler(const Route&)>& wrap) {
    for (Route& route : routes_) route.handler = wrap(route);
  }

  struct Match {
    const Route* route = nullptr;  ///< Null if there is none with this path and method.
    std::vector<std::string> arguments;
    std::string allowed;  ///< Methods of that path, "GET, POST"; empty: no such path.
  };
  [[nodiscard]] Match Find(std::string_view method, std::string_view path) const;
  [[nodiscard]] const std::vector<Route>& routes() const { return routes_; }

 private:
  std::vector<Route> routes_;
};

}  // namespace plumb::web
