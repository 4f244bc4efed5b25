// SPDX-License-Identifier: Apache-2.0
// Passes the events of the appliance on to the page and to the watchers of the control socket.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "web/service/appliance_service.hpp"

namespace plumb {

/// Used on the loop's thread. A listener that throws is logged and changes nothing else.
class Notices {
 public:
  /// @param data_changed  Called when stored data has changed, before the page is notified.
  explicit Notices(std::function<void()> data_changed);

  void SetPage(std::function<void(web::EventKind)> listener);
  /// Gets each event as one JSON object ({"event", "time", ...}).
  void SetWatchers(std::function<void(const std::string& line)> listener);

  void TellPage(web::EventKind kind);
  /// How often stored data has changed.
  [[nodiscard]] std::uint64_t data_changes() const { return data_changes_; }
  void TellWatchers(const nlohmann::json& event) const;

 private:
  const std::function<void()> data_changed_;
  std::uint64_t data_changes_ = 0;
  std::function<void(web::EventKind)> page_;
  std::function<void(const std::string&)> watchers_;
};

}  // namespace plumb
