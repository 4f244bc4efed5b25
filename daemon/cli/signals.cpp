// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/signals.hpp"

#include <csignal>

#include <pthread.h>

namespace plumb {
namespace {

sigset_t StopSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGUSR1}) sigaddset(&signals, signal);
  return signals;
}

}  // namespace

SignalStop::SignalStop() {
  std::signal(SIGPIPE, SIG_IGN);
  const sigset_t signals = StopSignals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiter_ = std::jthread([this, signals](const std::stop_token& end) {
    while (!end.stop_requested()) {
      int signal = 0;
      if (sigwait(&signals, &signal) == 0 && signal != SIGUSR1) source_.request_stop();
    }
  });
}

SignalStop::~SignalStop() {
  waiter_.request_stop();
  pthread_kill(waiter_.native_handle(), SIGUSR1);  // only to wake the waiting thread
  waiter_.join();
}

}  // namespace plumb
