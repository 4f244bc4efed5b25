// SPDX-License-Identifier: Apache-2.0
// Linked into every program that is built with the thread sanitizer: TBB starts no threads of its
// own.
//
// Debian builds TBB without instrumentation, so the sanitizer does not see how its threads hand
// over work. Each read of what a task was given then looks like a race: it has to be suppressed,
// with everything that happens in a task, and finding and suppressing it a million times made
// plumbd take 450 s to start. With all tasks on the thread that asked for them the threads of Plumb
// are checked with everything that they compute. Not checked are two tasks of one loop against each
// other: that they write to slots of their own is tested by results that are the same bits on any
// number of processors.
#include <cstddef>

#include <tbb/global_control.h>

namespace {

const tbb::global_control kOneThread(tbb::global_control::max_allowed_parallelism, std::size_t{1});

}  // namespace
