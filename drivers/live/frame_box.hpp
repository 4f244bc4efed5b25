// SPDX-License-Identifier: Apache-2.0
// Passes image pairs from the thread that reads a sensor to the thread that uses them.
#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "drivers/live/frame_pairing.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Pairs images and keeps the newest few. All functions may be called from any thread; only Take()
/// blocks.
class FrameBox {
 public:
  using Clock = std::chrono::steady_clock;
  struct Pair {
    FramePairing<cv::Mat>::Pair images;
    /// Counted since the last Flush(); a gap shows that pairs were dropped.
    std::int64_t index = 0;
  };

  /// @param name  Name of the sensor for messages.
  FrameBox(std::string name, std::chrono::microseconds max_gap,
           std::chrono::milliseconds stall_time);

  void Add(StreamKind kind, std::int64_t stamp_us, cv::Mat image);
  void CountDiscarded();
  /// Numbers of the images of a stream as counted by the driver, including invalid ones: a gap
  /// shows images that never arrived.
  void CountGaps(StreamKind kind, std::int64_t number);
  void Lose() noexcept;                  ///< The unit was unplugged for good.
  void SetFailed(bool failed) noexcept;  ///< The driver reports an error, or its end.
  void Fail(Message why);                ///< For good: Take() throws a DeviceError with it.
  void Interrupt() noexcept;             ///< Cannot be undone.
  void Flush() noexcept;
  void KeepStamps(bool keep);  ///< Starts keeping stamps for StampsOf().
  [[nodiscard]] std::vector<std::int64_t> StampsOf(StreamKind kind) const;
  /// The streams have started: from now on pairs must arrive (opening takes seconds on a slow bus),
  /// and the given number of first ones is dropped.
  void Begin(int pairs_to_skip);

  /// The oldest waiting pair, or nothing once interrupted. To be called repeatedly: a stall is
  /// attributed to the sensor only for time in which somebody was waiting.
  /// @throws ProcessStalled, DeviceLost, DeviceError as LiveSensor::Next().
  [[nodiscard]] std::optional<Pair> Take();
  [[nodiscard]] SensorStatistics statistics() const;
  [[nodiscard]] bool lost() const;

 private:
  void NoteAbsence();

  static constexpr std::size_t kCapacity =
      4;  ///< Pairs of 1.5 MB each; drops are counted in the queue of the user.

  const std::string name_;
  const std::chrono::milliseconds stall_time_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  FramePairing<cv::Mat> pairing_;
  std::deque<Pair> pairs_;
  std::deque<Clock::time_point> arrivals_;  ///< Arrivals of pairs within the last second.
  Clock::time_point last_arrival_ = Clock::now();
  Clock::time_point listened_ = Clock::now();  ///< Last time that Take() ran.
  Clock::duration absent_{};                   ///< Total delay of Take() since it last had a pair.
  Clock::duration
      longest_gap_{};  ///< Longest interval between two pairs since Take() last had one.
  std::int64_t next_index_ = 0;
  std::int64_t num_taken_ = 0;
  std::int64_t num_discarded_ = 0;
  std::int64_t num_lost_ = 0;
  std::array<std::optional<std::int64_t>, 2> last_number_;
  std::array<std::vector<std::int64_t>, 2> stamps_us_;  ///< Stamps of all images, colour and depth.
  bool keep_stamps_ = false;
  int skip_ = 0;
  bool lost_ = false;
  bool failed_ = false;
  std::optional<Message> why_failed_;
  bool interrupted_ = false;
};

}  // namespace plumb
