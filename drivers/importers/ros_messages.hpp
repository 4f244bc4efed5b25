// SPDX-License-Identifier: Apache-2.0
// The messages of a ROS recording, whatever its container: bags of ROS 1, SQLite and MCAP of ROS 2.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "words/foreign.hpp"

namespace plumb {

/// Where a message lies.
struct RosMessage {
  std::uint64_t chunk = 0;  ///< Place of its chunk in the file, or its row.
  std::size_t offset = 0;   ///< Of its data in the unpacked chunk.
  std::size_t size = 0;
  double time_s = 0.0;  ///< When it was recorded.
};

struct RosTopic {
  std::string name;
  std::string type;     ///< Such as "sensor_msgs/Image"; without the "/msg/" of ROS 2.
  bool is_cdr = false;  ///< How messages are written: as ROS 2 does; otherwise as ROS 1.
};

/// Most topics that a recording may have.
inline constexpr std::size_t kMostTopics = 10'000;
/// Largest unpacked chunk, and largest message: all that hostile files can make a reader allocate.
inline constexpr std::size_t kMostChunkBytes = std::size_t{256} << 20;

/// Not thread-safe.
class RosMessages {
 public:
  virtual ~RosMessages() = default;

  /// Such as "ROS bag".
  [[nodiscard]] virtual const char* format() const = 0;

  /// Called for each message in the order of the file. The data are valid during the call.
  /// @throws DataError for a damaged file.
  using Visit =
      std::function<void(const RosTopic&, const RosMessage&, std::span<const std::uint8_t> data)>;
  virtual void ForEach(const Visit& visit) = 0;

  /// The data of a message that ForEach() has shown; valid until the next call.
  /// @throws DataError
  [[nodiscard]] virtual std::span<const std::uint8_t> Read(const RosMessage& message) = 0;
};

/// The last two chunks that were unpacked: colour and depth alternate, often in chunks of their
/// own.
class UnpackedChunks {
 public:
  /// The data of the message. @param unpack  Makes the bytes of the chunk at a place.
  template <typename Unpack>
  std::span<const std::uint8_t> Read(const RosMessage& message, const Unpack& unpack) {
    Chunk* found = nullptr;
    for (Chunk& chunk : chunks_)
      if (chunk.place == message.chunk && !chunk.bytes.empty()) found = &chunk;
    if (found == nullptr) {
      found = &chunks_[next_];
      next_ = (next_ + 1) % chunks_.size();
      found->bytes.clear();  // If unpacking fails, the entry must not pass for the old chunk.
      found->bytes = unpack(message.chunk);
      found->place = message.chunk;
    }
    // The file may have changed since it was read.
    if (message.offset > found->bytes.size() || message.size > found->bytes.size() - message.offset)
      throw DataError(say::foreign::Unreadable());
    return std::span<const std::uint8_t>(found->bytes).subspan(message.offset, message.size);
  }

 private:
  struct Chunk {
    std::uint64_t place = 0;
    std::vector<std::uint8_t> bytes;
  };
  std::array<Chunk, 2> chunks_;
  std::size_t next_ = 0;
};

}  // namespace plumb
