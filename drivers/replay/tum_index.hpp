// SPDX-License-Identifier: Apache-2.0
// The index files of a TUM RGB-D recording (rgb.txt, depth.txt) and the pairing of their colour and
// depth images.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// A recording's list of the depth images, each a line of depth.txt, whose frames the computer
/// followed with fewer keypoints (Frame::fewer_keypoints), so that they are computed again alike.
inline constexpr const char* kFewerKeypointsFile = "fewer_keypoints.txt";

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

/// Typical time from one image to the next; 0 if there is only one.
[[nodiscard]] double MedianPeriod(std::span<const IndexEntry> entries);

/// How far apart the stamps of a pair may be: at least `least_s`, and more for slow streams.
[[nodiscard]] double LargestGap(std::span<const IndexEntry> color,
                                std::span<const IndexEntry> depth, double least_s);

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
