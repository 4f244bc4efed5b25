// SPDX-License-Identifier: Apache-2.0
// Frames on their way from the thread that reads them to the one that tracks them.
#pragma once

#include <chrono>
#include <optional>
#include <stop_token>

#include "algo/types/frame.hpp"

namespace plumb {

/// Frames that another thread reads, as the tracking thread takes them.
class FrameFeed {
 public:
  virtual ~FrameFeed() = default;
  /// Waits for the next frame; nothing at the end or on a stop request.
  virtual std::optional<Frame> Next(const std::stop_token& stop) = 0;
  /// Frames that were dropped since the last call, because tracking was late.
  virtual int TakeDropped() = 0;
  /// Called once, after Next() returned nothing without a stop request: throws the error that ended
  /// the reading, if any.
  virtual void Finish() = 0;
  /// Steady time at which the last frame arrived; not set where time has no meaning.
  [[nodiscard]] virtual std::optional<double> last_frame_s() const = 0;
  /// Likewise, of the frame that Next() returned last: others may have arrived since.
  [[nodiscard]] virtual std::optional<double> taken_arrived_s() const { return std::nullopt; }
};

/// Steady clock in seconds.
[[nodiscard]] inline double SteadySeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace plumb
