// SPDX-License-Identifier: Apache-2.0
// What becomes of memory that a scan frees.
#pragma once

#include <malloc.h>

namespace plumb {

/// Once, first in a program: memory that was freed stays with the process for what is allocated
/// next. A scan takes and frees images and matrices of megabytes thousands of times; each time the
/// system would have to hand out, and clear, their pages again.
/// All threads share one heap: glibc's heaps of single threads are made of pieces of 64 MB, which
/// it gives back as soon as they are empty, and what one thread frees another could not use.
inline void KeepFreedMemory() {
  constexpr int kLargestKept = 32 << 20;  // The most that glibc allows.
  constexpr int kKeptInTotal = 512 << 20;
  mallopt(M_ARENA_MAX, 1);
  mallopt(M_MMAP_THRESHOLD, kLargestKept);
  mallopt(M_TRIM_THRESHOLD, kKeptInTotal);
}

/// After a scan, and from time to time between scans: hands all freed memory back to the system.
inline void ReturnFreedMemory() { malloc_trim(0); }

}  // namespace plumb
