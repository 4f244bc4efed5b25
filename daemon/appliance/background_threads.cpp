#include "daemon/appliance/background_threads.hpp"

#include <utility>

namespace plumb {

bool BackgroundThreads::Later(web::Aside where, std::function<void()> work,
                              std::function<void()> done) {
  WorkThread& thread = where == web::Aside::kReads ? reads_ : files_;
  return thread.Post(
      [loop = &loop_, work = std::move(work), done = std::move(done), alive = alive_] {
        work();
        loop->Post("done aside", [done, alive] {
          if (*alive) done();
        });
      });
}

}  // namespace plumb
