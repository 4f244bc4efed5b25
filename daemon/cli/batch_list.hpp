// SPDX-License-Identifier: Apache-2.0
// Lists of work: one item a line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string_view>
#include <vector>

namespace plumb {

using BatchInputs = std::vector<std::filesystem::path>;

/// Reads a list of paths, which are relative to the working directory. Empty lines and those that
/// begin with # are skipped. With one path an item, a line is the path. With more, a line with tabs
/// is split at them and holds paths as they are; any other is split at blanks, and a path with
/// blanks stands in quotes, single or double, in which nothing is escaped.
/// @throws DataError naming the line: another number of paths, an open quote, a NUL; also for a
///         list without items, or one that is too long.
[[nodiscard]] std::vector<BatchInputs> ReadBatchList(const std::filesystem::path& file,
                                                     std::size_t paths_an_item);
/// @param name  Of the list, for messages.
[[nodiscard]] std::vector<BatchInputs> ParseBatchList(std::string_view text, std::string_view name,
                                                      std::size_t paths_an_item);

}  // namespace plumb
