// SPDX-License-Identifier: Apache-2.0
// The threads beside the loop that the page's handlers use.
#pragma once

#include <functional>

#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "web/service/background_work.hpp"

namespace plumb {

/// Used on the loop's thread. Destroyed before the objects that its work uses.
class BackgroundThreads : public web::BackgroundWork {
 public:
  /// The loop is borrowed and outlives this object.
  explicit BackgroundThreads(EventLoop& loop) : loop_(loop) {}

  [[nodiscard]] bool RunInBackground(web::BackgroundPool where, std::function<void()> work,
                                     std::function<void()> done) override;
  /// For work on files that reports in its own way. False if too much work is queued already.
  [[nodiscard]] bool PostToFiles(std::function<void()> work) {
    return files_.Post(std::move(work));
  }

 private:
  EventLoop& loop_;
  AliveFlag alive_;
  WorkThread reads_{64}, files_{64}, imports_{8};
};

}  // namespace plumb
