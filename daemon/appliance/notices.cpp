// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/notices.hpp"

#include <exception>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/appliance/control_lines.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/sweep/explain.hpp"

namespace plumb {
namespace {

/// The loop ends with an exception that leaves its callbacks; a listener that fails must not do
/// that.
void Guarded(const char* whom, const std::function<void()>& notify) try {
  notify();
} catch (const std::exception& error) {
  Log(LogLevel::kError,
      fmt::format("{} could not be notified: {}", whom, Explain(error).English()));
}

}  // namespace

Notices::Notices(std::function<void()> data_changed) : data_changed_(std::move(data_changed)) {}

void Notices::SetPage(std::function<void(web::EventKind)> listener) { page_ = std::move(listener); }

void Notices::SetWatchers(std::function<void(const std::string&)> listener) {
  watchers_ = std::move(listener);
}

void Notices::TellPage(web::EventKind kind) {
  if (kind == web::EventKind::kData) {
    ++data_changes_;
    data_changed_();
  }
  if (page_) Guarded("the page", [&] { page_(kind); });
}

void Notices::TellWatchers(const nlohmann::json& event) const {
  if (watchers_) Guarded("the control socket's watchers", [&] { watchers_(EventLine(event)); });
}

}  // namespace plumb
