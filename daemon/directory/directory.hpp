// SPDX-License-Identifier: Apache-2.0
// Asks the clinic's directory beside the loop.
#pragma once

#include <functional>
#include <stop_token>
#include <string>

#include "daemon/config/directory_settings.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "web/security/directory_answer.hpp"

namespace plumb {

/// Used on the loop's thread. One question at a time: people who log in wait for each other, and
/// other requests for none of them. Destruction ends the question that is open.
class Directory {
 public:
  /// @param loop  Outlives this object.
  Directory(EventLoop& loop, DirectorySettings settings);
  ~Directory() { stop_.request_stop(); }
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;

  /// As web::AskDirectory.
  [[nodiscard]] bool Ask(const std::string& name, std::string password,
                         std::function<void(const web::DirectoryAnswer&)> done);

 private:
  EventLoop& loop_;
  DirectorySettings settings_;
  AliveFlag alive_;
  std::stop_source stop_;
  WorkThread questions_{8};  // last: its thread uses the others
};

}  // namespace plumb
