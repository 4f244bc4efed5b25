// SPDX-License-Identifier: Apache-2.0
// One stream, depth or colour, of a virtual unit.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>

#include "drivers/simulator/player/frame_cache.hpp"
#include "tests/devices/openni_plugin/oni_driver.hpp"

namespace plumb::simulated {

/// Behaves like the real driver in the details that have caused errors in programs: mirrored by
/// default, with cropping answered (the player of recordings needs it). OpenNI2 calls the
/// properties from the application's threads; Emit() is called from the unit's.
class VirtualStream : public oni::driver::StreamBase {
 public:
  static constexpr int kMaxDepth = 10000;  ///< Millimetres; the recorder corrupts larger values.
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
    std::span<const std::uint8_t> bytes;  ///< RGB or 16-bit depth of the whole image.
    int frame_index = 0;
    std::uint64_t stamp_us = 0;
    int shift = 0;  ///< Columns by which depth is displaced to the left, as without registration.
    bool small = false;  ///< Has half the size, and states it.
  };
  void Emit(const Picture& picture);

 private:
  void Copy(const Picture& picture, void* out) const;

  const bool depth_;
  const FrameCacheShape shape_;
  std::mutex mutex_;  ///< Held while a frame is delivered, so that stop() returns only afterwards.
  std::atomic<bool> running_{false};
  std::atomic<OniBool> mirror_;
  OniBool auto_exposure_ = TRUE;
  OniBool auto_white_balance_ = TRUE;
};

}  // namespace plumb::simulated
