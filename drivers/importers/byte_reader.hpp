// SPDX-License-Identifier: Apache-2.0
// Reads numbers and texts of a file format from bytes: little-endian, in order, never past the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>
#include <type_traits>

#include "algo/base/errors.hpp"
#include "words/foreign.hpp"

namespace plumb {

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : left_(bytes) {}

  [[nodiscard]] std::size_t left() const { return left_.size(); }

  /// @throws DataError if fewer are left, here and below.
  std::span<const std::uint8_t> Take(std::size_t count) {
    if (count > left_.size())
      throw DataError(say::foreign::EndsEarly(static_cast<std::int64_t>(count),
                                              static_cast<std::int64_t>(left_.size())));
    const auto taken = left_.first(count);
    left_ = left_.subspan(count);
    return taken;
  }
  template <typename Number>
  Number Get() {
    static_assert(std::is_arithmetic_v<Number>);
    Number number{};
    std::memcpy(&number, Take(sizeof number).data(), sizeof number);
    return number;
  }
  /// Bytes, or a text, that follow their count in 32 bits.
  std::span<const std::uint8_t> Counted() { return Take(Get<std::uint32_t>()); }
  std::string_view Text() {
    const auto bytes = Counted();
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

 private:
  std::span<const std::uint8_t> left_;
};

}  // namespace plumb
