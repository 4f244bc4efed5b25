// SPDX-License-Identifier: Apache-2.0
// The table of routes: handler and permission of each.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"
#include "web/http/message.hpp"
#include "web/security/permissions.hpp"

namespace plumb::web {

enum class BodyKind {
  kNone,
  kJson,
  kForm,
  kFile,  ///< Written directly to the disk: Request::upload.
};

/// The record that a route names by its first path parameter: displays in the room may read it
/// while the status names it.
enum class ShownRecord : std::uint8_t { kNone, kPatient, kReference, kScan, kScanFile };

struct Route {
  std::string method;
  std::string pattern;  ///< "/api/v1/scans/{id}"; a path parameter is a whole segment.
  Permission permission = Permission::kView;
  BodyKind body = BodyKind::kNone;
  Handler handler;
  /// Actions for the audit log if the answer contains patient data, including the camera picture: a
  /// view is logged once per hour, a download each time. Both empty: it contains none. The status
  /// and its events do not count: they only name the open session.
  std::string_view view = {}, download = {};
  /// Without a record, a route with path parameters is refused to displays in the room.
  ShownRecord shown = ShownRecord::kNone;
  std::uint64_t most_bytes = 0;  ///< Of a file; 0: those of the server's options.
  Message absent = {};           ///< The refusal to a display: as if there were no such record.

  [[nodiscard]] std::string Name() const { return method + " " + pattern; }
  [[nodiscard]] bool DisclosesPatientData() const { return !view.empty() || !download.empty(); }
  Route& Discloses(std::string_view view_action, std::string_view download_action = {}) {
    view = view_action;
    download = download_action;
    return *this;
  }
  Route& ShowsDisplays(ShownRecord record, Message when_absent) {
    shown = record;
    absent = std::move(when_absent);
    return *this;
  }
};

/// The table; filled once and only read afterwards.
class Router {
 public:
  /// The result is valid until the next call.
  Route& Add(Route route) { return routes_.emplace_back(std::move(route)); }
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
