// SPDX-License-Identifier: Apache-2.0
// Trying again while another process holds a lock.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "daemon/database/database.hpp"

namespace plumb {

/// Waits for that time. Tests replace it; empty: the thread sleeps.
using Sleep = std::function<void(std::chrono::milliseconds)>;

/// Returns what `action` returns. Nothing reports that another process releases SQLite's locks or a
/// folder's, so DatabaseBusy is tried again after each pause.
/// @throws DatabaseBusy after `longest`; everything else that `action` throws
template <typename Action>
auto RetryWhileBusy(std::chrono::milliseconds longest, std::chrono::milliseconds pause,
                    const Sleep& sleep, const Action& action) {
  for (std::chrono::milliseconds waited{0};; waited += pause) {
    try {
      return action();
    } catch (const DatabaseBusy&) {
      if (waited >= longest) throw;
    }
    if (sleep) {
      sleep(pause);
    } else {
      std::this_thread::sleep_for(pause);
    }
  }
}

}  // namespace plumb
