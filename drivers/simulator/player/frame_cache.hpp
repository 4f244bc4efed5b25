// SPDX-License-Identifier: Apache-2.0
// Pre-rendered raw frames on the disk, which the virtual sensor plays. Independent of image
// libraries, so that the plug-in stays small.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace plumb::simulated {

/// Before the number of the process, at the end of the name of a file that is not complete yet.
inline constexpr std::string_view kPartialMark = ".partial-";

/// Stamps of one pair, microseconds from the sweep's start.
struct CachedStamps {
  std::int64_t color_us = 0;
  std::int64_t depth_us = 0;
};

struct FrameCacheShape {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t num_frames = 0;
  std::uint32_t period_us = 0;  ///< Nominal, between frames.
  std::uint32_t version = 0;    ///< Version of the simulator that rendered them.
  bool operator==(const FrameCacheShape&) const = default;
  [[nodiscard]] std::size_t color_bytes() const { return std::size_t{3} * width * height; }
  [[nodiscard]] std::size_t depth_bytes() const { return std::size_t{2} * width * height; }
  [[nodiscard]] std::size_t record_bytes() const {
    return sizeof(CachedStamps) + color_bytes() + depth_bytes();
  }
};

/// Reads frames in any order, directly from the file (the kernel caches them), so it needs no
/// memory of its own. Immutable after opening: may be read from any number of threads.
class FrameCacheReader {
 public:
  /// @throws std::runtime_error if the file is missing, not a cache or incomplete.
  explicit FrameCacheReader(const std::filesystem::path& file);
  ~FrameCacheReader();
  FrameCacheReader(const FrameCacheReader&) = delete;
  FrameCacheReader& operator=(const FrameCacheReader&) = delete;

  [[nodiscard]] const FrameCacheShape& shape() const { return shape_; }
  /// @param rgb    Of size color_bytes(). @param depth_mm  Of size width x height.
  /// @throws std::runtime_error if the disk fails; std::out_of_range.
  [[nodiscard]] CachedStamps Read(std::uint32_t frame, std::span<std::uint8_t> rgb,
                                  std::span<std::uint16_t> depth_mm) const;

 private:
  int descriptor_ = -1;
  FrameCacheShape shape_;
};

/// Header before the first frame.
[[nodiscard]] std::string FrameCacheHeader(const FrameCacheShape& shape);

}  // namespace plumb::simulated
