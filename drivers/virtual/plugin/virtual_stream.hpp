// One stream, depth or colour, of a virtual unit.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>

#include "drivers/virtual/frame_cache.hpp"
#include "drivers/virtual/plugin/oni_driver.hpp"

namespace plumb::simulated {

/// Behaves as the real driver does where programs have stumbled: mirrored by default,
/// cropping answered (the player of recordings needs it). OpenNI2 calls the properties from the
/// application's threads, Emit() comes from the unit's.
class VirtualStream : public oni::driver::StreamBase {
 public:
  static constexpr int kMaxDepth = 10000;  ///< mm; the recorder damages what is not below.
  [[nodiscard]] static OniVideoMode Mode(bool depth, const FrameCacheShape& shape);

  VirtualStream(bool depth, const FrameCacheShape& shape)
      : depth_(depth), shape_(shape), mirror_(TRUE) {}

  OniStatus start() override;
  void stop() override;
  OniBool isPropertySupported(int id) override;
  OniStatus getProperty(int id, void* data, int* size) override;
  OniStatus setProperty(int id, const void* data, int size) override;

  [[nodiscard]] bool running() const { return running_; }
  [[nodiscard]] bool is_depth() const { return depth_; }

  struct Picture {
    std::span<const std::uint8_t> bytes;  ///< RGB or 16-bit depth, of the whole image.
    int frame_index = 0;
    std::uint64_t stamp_us = 0;
    int shift = 0;       ///< Columns to the left that depth is off, as without registration.
    bool small = false;  ///< Claims to be, and is, of half the size.
  };
  void Emit(const Picture& picture);

 private:
  void Copy(const Picture& picture, void* out) const;

  const bool depth_;
  const FrameCacheShape shape_;
  std::mutex mutex_;  ///< Held while a frame is handed over: stop() returns only after that.
  std::atomic<bool> running_{false};
  std::atomic<OniBool> mirror_;
  OniBool auto_exposure_ = TRUE;
  OniBool auto_white_balance_ = TRUE;
};

}  // namespace plumb::simulated
