// Where the thread that reads a sensor leaves image pairs for the thread that uses them.
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

/// Pairs images and holds the newest few. All functions may be called from any thread; only Take()
/// waits.
class FrameBox {
 public:
  using Clock = std::chrono::steady_clock;
  struct Pair {
    FramePairing<cv::Mat>::Pair images;
    std::int64_t index = 0;  ///< Since the last Flush(); a gap shows that pairs were thrown away.
  };

  /// @param name  Of the sensor, for messages.
  FrameBox(std::string name, std::chrono::microseconds max_gap,
           std::chrono::milliseconds stall_time);

  void Add(StreamKind kind, std::int64_t stamp_us, cv::Mat image);
  void CountDiscarded();
  /// Numbers of the images of a stream as the driver counts them, of wrong ones too: a gap shows
  /// what never came.
  void CountGaps(StreamKind kind, std::int64_t number);
  void Lose() noexcept;                  ///< The unit is gone for good.
  void SetFailed(bool failed) noexcept;  ///< The driver reports an error, or that it is over.
  void Interrupt() noexcept;             ///< For good.
  void Flush() noexcept;
  void KeepStamps(bool keep);  ///< From now on, for StampsOf().
  [[nodiscard]] std::vector<std::int64_t> StampsOf(StreamKind kind) const;
  /// The streams have started: from now on pairs must come (opening takes seconds on a slow bus),
  /// and the first so many are thrown away.
  void Begin(int pairs_to_skip);

  /// The oldest pair that waits; nothing once interrupted. To be called again and again: the sensor
  /// is blamed for the stall time only while somebody listened.
  /// @throws ProcessStalled, DeviceLost, DeviceError as LiveSensor::Next().
  [[nodiscard]] std::optional<Pair> Take();
  [[nodiscard]] SensorStatistics statistics() const;
  [[nodiscard]] bool lost() const;

 private:
  void NoteAbsence();

  static constexpr std::size_t kCapacity =
      4;  ///< Pairs of 1.5 MB; the user's own queue is the one that counts what it drops.

  const std::string name_;
  const std::chrono::milliseconds stall_time_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  FramePairing<cv::Mat> pairing_;
  std::deque<Pair> pairs_;
  std::deque<Clock::time_point> arrivals_;  ///< Of pairs, within the last second.
  Clock::time_point last_arrival_ = Clock::now();
  Clock::time_point listened_ = Clock::now();  ///< When Take() last ran.
  Clock::duration absent_{};       ///< By how much it ran late since it last had a pair,
  Clock::duration longest_gap_{};  ///< and between two pairs since then.
  std::int64_t next_index_ = 0;
  std::int64_t num_taken_ = 0;
  std::int64_t num_discarded_ = 0;
  std::int64_t num_lost_ = 0;
  std::array<std::optional<std::int64_t>, 2> last_number_;
  std::array<std::vector<std::int64_t>, 2>
      stamps_us_;  ///< Of all images that came, colour and depth.
  bool keep_stamps_ = false;
  int skip_ = 0;
  bool lost_ = false;
  bool failed_ = false;
  bool interrupted_ = false;
};

}  // namespace plumb
