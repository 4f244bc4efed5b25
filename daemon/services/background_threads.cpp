// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/background_threads.hpp"

#include <utility>

namespace plumb {

bool BackgroundThreads::RunInBackground(web::BackgroundPool where, std::function<void()> work,
                                        std::function<void()> done) {
  WorkThread& thread = where == web::BackgroundPool::kReads   ? reads_
                       : where == web::BackgroundPool::kFiles ? files_
                                                              : imports_;
  return thread.Post(
      [loop = &loop_, work = std::move(work), done = alive_.WhileAlive(std::move(done))] {
        work();
        loop->Post("background work done", done);
      });
}

}  // namespace plumb
