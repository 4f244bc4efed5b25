// SPDX-License-Identifier: Apache-2.0
// Reads the fields of a ROS message in order, never past the end. ROS 1 packs them without gaps;
// ROS 2 writes CDR: four bytes that name the order of bytes, then numbers aligned to their size,
// and texts that count their final NUL.
#pragma once

#include <algorithm>

#include "drivers/importers/byte_reader.hpp"

namespace plumb {

class RosReader {
 public:
  /// @throws DataError if fewer bytes are left, here and below; for big-endian messages.
  RosReader(std::span<const std::uint8_t> data, bool is_cdr) : reader_(data), is_cdr_(is_cdr) {
    if (!is_cdr_) return;
    const auto kind = reader_.Take(4);
    if (kind[0] != 0 || kind[1] != 1) throw DataError(say::foreign::BigEndian());
    size_ = reader_.left();
  }

  template <typename Number>
  Number Get() {
    if (is_cdr_) {
      const std::size_t past = (size_ - reader_.left()) % sizeof(Number);
      if (past != 0) (void)reader_.Take(sizeof(Number) - past);
    }
    return reader_.Get<Number>();
  }
  std::span<const std::uint8_t> Counted() { return reader_.Take(Get<std::uint32_t>()); }
  std::string_view Text() {
    const auto bytes = Counted();
    std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    if (is_cdr_ && text.ends_with('\0')) text.remove_suffix(1);
    return text;
  }

  struct Header {
    double stamp_s = 0.0;
    std::string_view frame;
  };
  Header TakeHeader() {
    if (!is_cdr_) (void)Get<std::uint32_t>();  // A number that counts messages.
    Header header;
    header.stamp_s = Get<std::uint32_t>();
    header.stamp_s += 1e-9 * Get<std::uint32_t>();
    header.frame = Text();
    return header;
  }

 private:
  ByteReader reader_;
  bool is_cdr_;
  std::size_t size_ = 0;  ///< Of what is aligned.
};

}  // namespace plumb
