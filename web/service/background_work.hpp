// SPDX-License-Identifier: Apache-2.0
// Threads beside the loop.
#pragma once

#include <functional>

namespace plumb::web {

/// Threads beside the loop, for work that may take long.
enum class BackgroundPool {
  kReads,    ///< Lists, and files that are opened and read.
  kFiles,    ///< What may take minutes: writing and removing large files, updates.
  kImports,  ///< Planning CTs, of which one may take minutes.
};

/// Called on the loop thread.
class BackgroundWork {
 public:
  virtual ~BackgroundWork() = default;

  /// Runs `work` beside the loop, in order for each kind, then calls `done` on the loop. Neither
  /// may throw. `work` may call the functions marked (background), FindPatient(), FindReference()
  /// and FindScan().
  /// @return False if the queue is full: neither is called then.
  [[nodiscard]] virtual bool RunInBackground(BackgroundPool where, std::function<void()> work,
                                             std::function<void()> done) = 0;
};

}  // namespace plumb::web
