// Threads beside the loop.
#pragma once

#include <functional>

namespace plumb::web {

/// Threads beside the loop, for what may take its time.
enum class Aside {
  kReads,  ///< Lists, and files that are opened.
  kFiles,  ///< Writing and removing large files.
};

/// Called on the loop thread.
class BackgroundWork {
 public:
  virtual ~BackgroundWork() = default;

  /// Has `work` done beside the loop, one after the other of its kind, then calls `done` on the
  /// loop. Neither may throw. Within `work` the functions marked (aside), FindPatient(),
  /// FindReference() and FindScan() may be called.
  /// @return False where too much waits already: neither is called then.
  [[nodiscard]] virtual bool Later(Aside where, std::function<void()> work,
                                   std::function<void()> done) = 0;
};

}  // namespace plumb::web
