// SPDX-License-Identifier: Apache-2.0
#include "drivers/live/frame_box.hpp"

#include <algorithm>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

constexpr std::chrono::seconds kRateWindow{1};
// longest time between two checks of the clock in Take()
constexpr std::chrono::milliseconds kLook{100};
constexpr std::size_t kMaxStamps = 100'000;

std::size_t Side(StreamKind kind) { return kind == StreamKind::kColor ? 0 : 1; }

}  // namespace

FrameBox::FrameBox(std::string name, std::chrono::microseconds max_gap,
                   std::chrono::milliseconds stall_time)
    : name_(std::move(name)), stall_time_(stall_time), pairing_(max_gap.count()) {}

void FrameBox::Add(StreamKind kind, std::int64_t stamp_us, cv::Mat image) {
  {
    const std::lock_guard lock(mutex_);
    if (std::vector<std::int64_t>& stamps = stamps_us_[Side(kind)];
        keep_stamps_ && stamps.size() < kMaxStamps)
      stamps.push_back(stamp_us);
    auto pair = pairing_.Add(kind, stamp_us, std::move(image));
    if (!pair) return;
    if (skip_ > 0) {
      --skip_;
      return;
    }
    const Clock::time_point now = Clock::now();
    longest_gap_ = std::max(longest_gap_, now - std::exchange(last_arrival_, now));
    arrivals_.push_back(last_arrival_);
    while (arrivals_.front() + kRateWindow < last_arrival_) arrivals_.pop_front();
    pairs_.push_back({std::move(*pair), next_index_++});
    if (pairs_.size() > kCapacity) {
      pairs_.pop_front();
      num_lost_ += 2;
    }
  }
  changed_.notify_all();
}

void FrameBox::CountDiscarded() {
  const std::lock_guard lock(mutex_);
  ++num_discarded_;
}

void FrameBox::CountGaps(StreamKind kind, std::int64_t number) {
  const std::lock_guard lock(mutex_);
  std::optional<std::int64_t>& last = last_number_[Side(kind)];
  if (last && number <= *last) return;  // a duplicate or out of order; counted as such
  if (last) num_lost_ += number - *last - 1;
  last = number;
}

void FrameBox::Lose() noexcept {
  {
    const std::lock_guard lock(mutex_);
    lost_ = true;
  }
  changed_.notify_all();
}

void FrameBox::SetFailed(bool failed) noexcept {
  {
    const std::lock_guard lock(mutex_);
    failed_ = failed;
  }
  changed_.notify_all();
}

void FrameBox::Fail(Message why) {
  {
    const std::lock_guard lock(mutex_);
    if (!why_failed_) why_failed_ = std::move(why);
  }
  changed_.notify_all();
}

void FrameBox::Interrupt() noexcept {
  {
    const std::lock_guard lock(mutex_);
    interrupted_ = true;
  }
  changed_.notify_all();
}

void FrameBox::Flush() noexcept {
  const std::lock_guard lock(mutex_);
  pairs_.clear();
  pairing_.Clear();
  listened_ = Clock::now();
  absent_ = longest_gap_ = {};
  next_index_ = 0;
}

void FrameBox::KeepStamps(bool keep) {
  const std::lock_guard lock(mutex_);
  keep_stamps_ = keep;
  for (auto& stamps : stamps_us_) stamps.clear();
}

std::vector<std::int64_t> FrameBox::StampsOf(StreamKind kind) const {
  const std::lock_guard lock(mutex_);
  return stamps_us_[Side(kind)];
}

void FrameBox::Begin(int pairs_to_skip) {
  const std::lock_guard lock(mutex_);
  skip_ = pairs_to_skip;
  last_arrival_ = listened_ = Clock::now();
  absent_ = longest_gap_ = {};
}

/// A process that was stopped, or got no processor time, wakes up late. The driver's threads belong
/// to it, so that missing pairs then say nothing about the sensor. If pairs arrived nevertheless,
/// only the caller was busy.
void FrameBox::NoteAbsence() {
  const Clock::time_point now = Clock::now();
  absent_ += std::max(Clock::duration::zero(), now - listened_ - kLook);
  listened_ = now;
}

std::optional<FrameBox::Pair> FrameBox::Take() {
  std::unique_lock lock(mutex_);
  for (;;) {
    NoteAbsence();
    if (interrupted_) return std::nullopt;
    if (lost_) throw DeviceLost(say::sensor::Unplugged(name_));
    if (why_failed_) throw DeviceError(*why_failed_);
    if (failed_) throw DeviceError(say::sensor::DriverError(name_));
    if (std::min(absent_, std::max(longest_gap_, listened_ - last_arrival_)) >= stall_time_) {
      const auto absent = std::chrono::duration_cast<std::chrono::milliseconds>(
          std::exchange(absent_, Clock::duration::zero()));
      last_arrival_ = listened_;
      longest_gap_ = {};
      throw ProcessStalled(
          say::sensor::ProcessStalled(name_, 1e-3 * static_cast<double>(absent.count())));
    }
    if (!pairs_.empty()) break;
    const Clock::time_point limit = last_arrival_ + stall_time_ + absent_;
    if (listened_ >= limit) {
      throw DeviceError(say::sensor::NoImages(name_, stall_time_.count(), pairing_.num_unpaired(),
                                              pairing_.num_discarded() + num_discarded_));
    }
    changed_.wait_until(lock, std::min(limit, listened_ + kLook));
  }
  absent_ = longest_gap_ = {};
  Pair pair = std::move(pairs_.front());
  pairs_.pop_front();
  ++num_taken_;
  return pair;
}

SensorStatistics FrameBox::statistics() const {
  const std::lock_guard lock(mutex_);
  SensorStatistics statistics;
  statistics.num_pairs = num_taken_;
  statistics.num_unpaired = pairing_.num_unpaired();
  statistics.num_discarded = pairing_.num_discarded() + num_discarded_;
  statistics.num_lost = num_lost_;
  const Clock::time_point begin = Clock::now() - kRateWindow;
  for (const Clock::time_point& arrival : arrivals_)
    statistics.frames_per_second += arrival > begin ? 1.0 : 0.0;
  return statistics;
}

bool FrameBox::lost() const {
  const std::lock_guard lock(mutex_);
  return lost_;
}

}  // namespace plumb
