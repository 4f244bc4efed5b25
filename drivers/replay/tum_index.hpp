// The index files of a TUM RGB-D recording (rgb.txt, depth.txt) and the pairing of their colour and
// depth images.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// One line of an index.
struct IndexEntry {
  double time_s = 0.0;
  /// Relative to the recording's folder, with '/'; does not leave the folder as far as the text
  /// shows.
  std::string file;
};

/// The entries of an index: lines "timestamp filename"; comments (#) and empty lines are skipped;
/// CR LF, tabs and commas are accepted. Stamps are seconds, not negative, and increase strictly
/// from line to line.
/// @param name  Name of the file for messages, which also state the line.
/// @throws DataError for anything else, for paths that are absolute or contain "..", and for more
///         than 1,000,000 entries.
[[nodiscard]] std::vector<IndexEntry> ParseIndex(std::string_view text, const std::string& name);

/// Positions of one colour and one depth image that belong together.
struct IndexPair {
  std::size_t color = 0;
  std::size_t depth = 0;
  bool operator==(const IndexPair&) const = default;
};

/// Pairs images that are at most `max_gap_s` apart, each at most once and in increasing order in
/// both lists, with the largest sum of (2 max_gap_s - gap). The nearest stamps are paired, but if
/// the two streams are half a frame apart, an image takes its second nearest partner rather than
/// leave another without any. Both lists must increase strictly; max_gap_s > 0.
[[nodiscard]] std::vector<IndexPair> AssociateByTime(std::span<const IndexEntry> color,
                                                     std::span<const IndexEntry> depth,
                                                     double max_gap_s);

}  // namespace plumb
