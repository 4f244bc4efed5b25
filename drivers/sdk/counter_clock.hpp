// SPDX-License-Identifier: Apache-2.0
// Continues a camera's counter of 32 bits.
#pragma once

#include <cstdint>
#include <optional>

namespace plumb {

/// Begins above 0, so that an image of the other stream from just before is not negative.
class CounterClock {
 public:
  std::int64_t Continue(std::int64_t stated) {
    constexpr std::int64_t kTurn = std::int64_t{1} << 32;
    if (!last_) last_ = kTurn + stated % kTurn;
    const auto step = static_cast<std::int32_t>(static_cast<std::uint32_t>(stated) -
                                                static_cast<std::uint32_t>(*last_));
    last_ = *last_ + step;
    return *last_;
  }

 private:
  std::optional<std::int64_t> last_;
};

}  // namespace plumb
