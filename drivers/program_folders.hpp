// SPDX-License-Identifier: Apache-2.0
// Finds files that are installed with the running program.
#pragma once

#include <filesystem>
#include <optional>

namespace plumb {

/// Searches for `relative` in the folders above the running program, nearest first: an installed
/// /usr/bin/plumb finds /usr/lib/plumb/..., and programs of a build tree find files in the build
/// folder.
[[nodiscard]] std::optional<std::filesystem::path> FindBesideProgram(
    const std::filesystem::path& relative);

}  // namespace plumb
