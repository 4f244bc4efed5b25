// SPDX-License-Identifier: Apache-2.0
// The records of a ROS 1 bag, version 2.0: connections and messages in chunks, plain or lz4.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "drivers/importers/recorded_file.hpp"

namespace plumb {

/// Where a message lies.
struct BagMessage {
  std::uint64_t chunk = 0;  ///< Place of the chunk's record in the file.
  std::size_t offset = 0;   ///< Of the message's data in the unpacked chunk.
  std::size_t size = 0;
  double time_s = 0.0;  ///< When it was recorded.
};

struct BagConnection {
  std::string topic, type;
};

/// Reads the file from beginning to end without its index, so that a bag whose recorder did not
/// finish can be read, too, unless a record is cut off. Even hostile files cannot take more memory
/// than a chunk of the largest size (256 MB). Not thread-safe.
class RosBag {
 public:
  /// @throws DataError unless the file begins like a bag of version 2.0.
  explicit RosBag(FileBytes bytes);

  /// Called for each message in the order of the file. The data are valid during the call.
  /// @throws DataError for a damaged file, and for chunks packed in another way (bz2).
  using Visit = std::function<void(const BagConnection&, const BagMessage&,
                                   std::span<const std::uint8_t> data)>;
  void ForEach(const Visit& visit);

  /// The data of a message that ForEach() has shown; valid until the next call.
  /// @throws DataError
  [[nodiscard]] std::span<const std::uint8_t> Read(const BagMessage& message);

 private:
  class Fields;
  struct Record;
  struct Chunk {
    std::uint64_t place = 0;
    std::vector<std::uint8_t> bytes;
  };
  [[nodiscard]] std::vector<std::uint8_t> BytesAt(std::uint64_t offset, std::size_t count) const;
  [[nodiscard]] Record RecordAt(std::uint64_t offset) const;
  [[nodiscard]] std::vector<std::uint8_t> Unpacked(const Record& record) const;
  void VisitChunk(std::uint64_t place, std::span<const std::uint8_t> chunk, const Visit& visit);

  FileBytes bytes_;
  std::map<std::uint32_t, BagConnection> connections_;
  std::array<Chunk, 2> unpacked_;  ///< Colour and depth alternate, often in chunks of their own.
  std::size_t next_ = 0;
};

}  // namespace plumb
