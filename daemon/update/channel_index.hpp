// SPDX-License-Identifier: Apache-2.0
// The index of a channel: a signed list of bundles in a folder of a web server.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

inline constexpr std::size_t kMaxIndexBytes = 256 << 10;

struct ChannelBundle {
  std::string name;     ///< NAME.raucb, in the folder of the index.
  std::string version;  ///< Of the system in it: 0.3.1.
  std::uint64_t bytes = 0;
  std::string sha256;  ///< 64 digits.
  double share = 1.0;  ///< Of the units, 0 to 1: those to which it is offered.
};

/// {"format": 1, "channel": "stable", "number": 17, "bundles": [{"name", "version", "bytes",
/// "sha256", "share"}]}
struct ChannelIndex {
  std::int64_t number = 0;  ///< Each index of a channel has a higher one.
  std::vector<ChannelBundle> bundles = {};
};

/// @param signature  Ed25519 of the text, 64 bytes. @param key  The public key in base64.
/// @param least_number  That of the newest index that was accepted before.
/// @throws DataError if it is not signed by that key, of another channel, older, or not an index
[[nodiscard]] ChannelIndex ReadChannelIndex(std::string_view text, std::string_view signature,
                                            std::string_view key, const std::string& channel,
                                            std::int64_t least_number);

/// Place of a unit in the order in which a bundle reaches the fleet, 0 to 1; another one for each
/// bundle, so that it is not always the same units that are first.
[[nodiscard]] double PlaceInFleet(const std::string& serial, const ChannelBundle& bundle);

/// The latest bundle that is later than what runs and has reached this unit's place.
[[nodiscard]] std::optional<ChannelBundle> OfferedTo(const ChannelIndex& index,
                                                     const std::string& serial,
                                                     const std::string& version);

}  // namespace plumb
