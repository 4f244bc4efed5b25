// SPDX-License-Identifier: Apache-2.0
// Converts Ctrl-C and SIGTERM to a stop request.
#pragma once

#include <stop_token>
#include <thread>

namespace plumb {

/// During its lifetime, SIGINT, SIGTERM and SIGHUP request a stop instead of ending the process; a
/// separate thread waits for them. Create it first in main(), before any other thread: the signals
/// are blocked in every thread that starts later. SIGPIPE is ignored; writes then report the error.
class SignalStop {
 public:
  SignalStop();
  ~SignalStop();
  SignalStop(const SignalStop&) = delete;
  SignalStop& operator=(const SignalStop&) = delete;

  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::jthread waiter_;
};

}  // namespace plumb
