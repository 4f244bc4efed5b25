// SPDX-License-Identifier: Apache-2.0
// The records of an MCAP file, as ROS 2 writes them: messages in chunks (plain, lz4 or Zstandard)
// or by themselves.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "drivers/importers/recorded_file.hpp"
#include "drivers/importers/ros_messages.hpp"

namespace plumb {

/// Reads the file from beginning to end without its index and summary. Messages that are not of ROS
/// (JSON, Protobuf) are passed over.
class McapFile : public RosMessages {
 public:
  /// @throws DataError unless the file begins like an MCAP file.
  explicit McapFile(FileBytes bytes);
  [[nodiscard]] const char* format() const override { return "ROS 2 .mcap"; }

  /// @throws DataError also for a file that is cut off, and for chunks packed in another way.
  void ForEach(const Visit& visit) override;
  [[nodiscard]] std::span<const std::uint8_t> Read(const RosMessage& message) override;

 private:
  struct Record;
  struct Schema {
    std::string type, encoding;
  };
  [[nodiscard]] std::vector<std::uint8_t> BytesAt(std::uint64_t offset, std::uint64_t count) const;
  [[nodiscard]] Record RecordAt(std::uint64_t offset) const;
  /// The records in a chunk, or the contents of a message that is in none.
  [[nodiscard]] std::vector<std::uint8_t> Unpacked(std::uint64_t place) const;
  void VisitChunk(std::uint64_t place, std::span<const std::uint8_t> chunk, const Visit& visit);
  void VisitRecord(std::uint8_t kind, std::span<const std::uint8_t> content, RosMessage place,
                   const Visit& visit);
  void NoteSchema(std::span<const std::uint8_t> content);
  void NoteChannel(std::span<const std::uint8_t> content);

  FileBytes bytes_;
  std::map<std::uint16_t, Schema> schemas_;
  std::map<std::uint16_t, RosTopic> topics_;  ///< By channel; those of ROS only.
  UnpackedChunks unpacked_;
};

}  // namespace plumb
