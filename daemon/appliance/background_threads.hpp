// The threads beside the loop that the page's handlers use.
#pragma once

#include <memory>

#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "web/service/background_work.hpp"

namespace plumb {

/// Used on the loop's thread. Destroyed before the objects that its work uses.
class BackgroundThreads : public web::BackgroundWork {
 public:
  /// The loop is borrowed and outlives this object.
  explicit BackgroundThreads(EventLoop& loop) : loop_(loop) {}
  ~BackgroundThreads() override { *alive_ = false; }
  BackgroundThreads(const BackgroundThreads&) = delete;
  BackgroundThreads& operator=(const BackgroundThreads&) = delete;

  [[nodiscard]] bool RunInBackground(web::BackgroundPool where, std::function<void()> work,
                                     std::function<void()> done) override;
  /// For work on files that reports in its own way. False if too much work is queued already.
  [[nodiscard]] bool PostToFiles(std::function<void()> work) {
    return files_.Post(std::move(work));
  }

 private:
  EventLoop& loop_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  WorkThread reads_{64}, files_{64};
};

}  // namespace plumb
