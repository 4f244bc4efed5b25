// SPDX-License-Identifier: Apache-2.0
// Lets the n-th call of a kind fail, in a program that tests/support/failing_calls.cpp was loaded
// into before its other libraries.
#pragma once

#include <dlfcn.h>

namespace plumb::testing {

enum class FailingCall : int { kOpen, kWrite, kSync, kRename, kMkdir };
inline constexpr int kNumFailingCalls = 5;

struct CallFault {
  FailingCall call = FailingCall::kWrite;
  long nth = 0;             ///< From 1; 0: none fails.
  int error = 0;            ///< 0: a write is cut short, and the next one fails with ENOSPC.
  bool for_good = false;    ///< All later ones fail too.
  const char* folder = "";  ///< Only of files below it.
};

/// Restarts the count. @return False where the library is not loaded.
inline bool Arm(const CallFault& fault) {
  using Function = void(int, long, int, int, const char*);
  auto* const arm = reinterpret_cast<Function*>(::dlsym(RTLD_DEFAULT, "plumb_arm_fault"));
  if (arm == nullptr) return false;
  arm(static_cast<int>(fault.call), fault.nth, fault.error, fault.for_good ? 1 : 0, fault.folder);
  return true;
}

/// No call fails any more. @return How many have failed since Arm().
inline long Disarm() {
  using Function = long();
  auto* const disarm = reinterpret_cast<Function*>(::dlsym(RTLD_DEFAULT, "plumb_disarm_fault"));
  return disarm == nullptr ? 0 : disarm();
}

}  // namespace plumb::testing
