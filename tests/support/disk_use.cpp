// SPDX-License-Identifier: Apache-2.0
// A library to be preloaded: every disk has 100 GB and is as full as PLUMB_DISK_USED_PERCENT says,
// regardless of the machine's disks.
#include <dlfcn.h>
#include <sys/statvfs.h>

#include <cstdlib>

extern "C" __attribute__((visibility("default"))) int statvfs(const char* path,
                                                              struct statvfs* disk) noexcept {
  static const auto kStatvfs = reinterpret_cast<decltype(&statvfs)>(::dlsym(RTLD_NEXT, "statvfs"));
  const int result = kStatvfs(path, disk);
  const char* percent = std::getenv("PLUMB_DISK_USED_PERCENT");
  if (result != 0 || percent == nullptr) return result;
  constexpr fsblkcnt_t kBlocksOfOnePercent = 250'000;
  disk->f_bsize = disk->f_frsize = 4000;
  disk->f_blocks = 100 * kBlocksOfOnePercent;
  disk->f_bfree = disk->f_bavail =
      disk->f_blocks - static_cast<fsblkcnt_t>(std::atoi(percent)) * kBlocksOfOnePercent;
  return 0;
}
