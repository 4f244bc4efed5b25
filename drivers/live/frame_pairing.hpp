// SPDX-License-Identifier: Apache-2.0
// Pairs colour and depth images by their stamps as they arrive.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>

namespace plumb {

enum class StreamKind { kColor, kDepth };

/// Pairs two streams of images with stamps of one clock. The allowed gap is less than half of the
/// frame period, so an image has at most one partner and it does not matter which stream delivers
/// first. Pure: no clock, no thread.
template <typename Image>
class FramePairing {
 public:
  struct Pair {
    std::int64_t color_us = 0;
    std::int64_t depth_us = 0;
    Image color;
    Image depth;
  };

  /// @param max_gap_us  Largest difference between the stamps of a pair.
  explicit FramePairing(std::int64_t max_gap_us) : max_gap_us_(max_gap_us) {}

  /// Takes the next image of a stream. An image that is not later than the one before it in its
  /// stream is discarded.
  std::optional<Pair> Add(StreamKind kind, std::int64_t stamp_us, Image image) {
    Side& side = kind == StreamKind::kColor ? color_ : depth_;
    if (side.last_us && stamp_us <= *side.last_us) {
      ++num_discarded_;
      return std::nullopt;
    }
    side.last_us = stamp_us;
    side.waiting.emplace_back(stamp_us, std::move(image));
    return Match();
  }

  /// Drops the images that wait for a partner, without counting them.
  void Clear() {
    color_.waiting.clear();
    depth_.waiting.clear();
  }

  [[nodiscard]] std::int64_t num_unpaired() const {
    return num_unpaired_;
  }  ///< Images that found no partner.
  [[nodiscard]] std::int64_t num_discarded() const {
    return num_discarded_;
  }  ///< Images that came twice or out of order.

 private:
  static constexpr std::size_t kMaxWaiting = 4;  ///< Of one stream while the other is silent.
  struct Side {
    std::optional<std::int64_t> last_us;
    std::deque<std::pair<std::int64_t, Image>> waiting;
  };

  void DropFront(Side& side) {
    side.waiting.pop_front();
    ++num_unpaired_;
  }

  std::optional<Pair> Match() {
    while (!color_.waiting.empty() && !depth_.waiting.empty()) {
      auto& color = color_.waiting.front();
      auto& depth = depth_.waiting.front();
      const std::int64_t gap = color.first - depth.first;
      if (gap > max_gap_us_) {
        DropFront(depth_);
      } else if (-gap > max_gap_us_) {
        DropFront(color_);
      } else {
        Pair pair{color.first, depth.first, std::move(color.second), std::move(depth.second)};
        color_.waiting.pop_front();
        depth_.waiting.pop_front();
        return pair;
      }
    }
    for (Side* side : {&color_, &depth_}) {
      while (side->waiting.size() > kMaxWaiting) DropFront(*side);
    }
    return std::nullopt;
  }

  std::int64_t max_gap_us_;
  Side color_;
  Side depth_;
  std::int64_t num_unpaired_ = 0;
  std::int64_t num_discarded_ = 0;
};

}  // namespace plumb
