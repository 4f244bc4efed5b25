// SPDX-License-Identifier: Apache-2.0
#include "drivers/program_folders.hpp"

namespace plumb {

std::optional<std::filesystem::path> FindBesideProgram(const std::filesystem::path& relative) {
  constexpr int kMaxLevels = 6;
  std::error_code error;
  std::filesystem::path folder =
      std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  for (int level = 0; level < kMaxLevels && !folder.empty(); ++level) {
    const std::filesystem::path candidate = folder / relative;
    if (std::filesystem::exists(candidate, error)) return candidate;
    if (folder == folder.root_path()) break;
    folder = folder.parent_path();
  }
  return std::nullopt;
}

}  // namespace plumb
