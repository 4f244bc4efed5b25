// SPDX-License-Identifier: Apache-2.0
// The records of a ROS 1 bag, version 2.0: connections and messages in chunks, plain or lz4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "drivers/importers/recorded_file.hpp"
#include "drivers/importers/ros_messages.hpp"

namespace plumb {

/// Reads the file from beginning to end without its index, so that a bag whose recorder did not
/// finish can be read, too, unless a record is cut off. Even hostile files cannot take more memory
/// than a chunk of the largest size (256 MB). Not thread-safe.
class RosBag : public RosMessages {
 public:
  /// @throws DataError unless the file begins like a bag of version 2.0.
  explicit RosBag(FileBytes bytes);
  [[nodiscard]] const char* format() const override { return "ROS bag"; }

  /// @throws DataError also for chunks packed in another way (bz2).
  void ForEach(const Visit& visit) override;
  [[nodiscard]] std::span<const std::uint8_t> Read(const RosMessage& message) override;

 private:
  class Fields;
  struct Record;
  [[nodiscard]] std::vector<std::uint8_t> BytesAt(std::uint64_t offset, std::size_t count) const;
  [[nodiscard]] Record RecordAt(std::uint64_t offset) const;
  [[nodiscard]] std::vector<std::uint8_t> Unpacked(const Record& record) const;
  void VisitChunk(std::uint64_t place, std::span<const std::uint8_t> chunk, const Visit& visit);

  FileBytes bytes_;
  std::map<std::uint32_t, RosTopic> connections_;
  UnpackedChunks unpacked_;
};

}  // namespace plumb
