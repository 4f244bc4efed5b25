// SPDX-License-Identifier: Apache-2.0
#include "daemon/loop/loop_meter.hpp"

#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <memory>

namespace plumb {
namespace {

using std::chrono::nanoseconds;

nanoseconds Read(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return std::chrono::seconds(now.tv_sec) + nanoseconds(now.tv_nsec);
}

/// Time that a thread waited for a processor as counted by the kernel: the second number of its
/// schedstat.
class QueuedTime {
 public:
  QueuedTime() : fd_(::open("/proc/thread-self/schedstat", O_RDONLY | O_CLOEXEC)) {}
  ~QueuedTime() {
    if (fd_ >= 0) ::close(fd_);
  }
  QueuedTime(const QueuedTime&) = delete;
  QueuedTime& operator=(const QueuedTime&) = delete;

  [[nodiscard]] nanoseconds Get() const {
    std::array<char, 96> text{};
    const ssize_t count = fd_ < 0 ? 0 : ::pread(fd_, text.data(), text.size(), 0);
    if (count <= 0) return {};
    const char* const begin = text.data();
    const char* const end = begin + count;
    const char* const second = std::find(begin, end, ' ');
    std::int64_t value = 0;
    if (second != end) std::from_chars(second + 1, end, value);
    return nanoseconds(value);
  }

 private:
  int fd_;
};

void Add(LoopFigures& figures, nanoseconds wall, nanoseconds cpu) {
  ++figures.count;
  figures.over_limit += wall > LoopMeter::kLimit ? 1 : 0;
  figures.cpu_over_limit += cpu > LoopMeter::kLimit ? 1 : 0;
  figures.longest = std::max(figures.longest, wall);
  figures.longest_cpu = std::max(figures.longest_cpu, cpu);
}

}  // namespace

LoopClocks ClocksOfThisThread() {
  return {.wall = [] { return Read(CLOCK_MONOTONIC); },
          .cpu = [] { return Read(CLOCK_THREAD_CPUTIME_ID); },
          .queued = [file = std::make_shared<const QueuedTime>()] { return file->Get(); }};
}

void LoopMeter::Begin(std::string_view what) {
  turn_ = what;
  part_.clear();
  longest_part_.clear();
  longest_part_wall_ = {};
  queued_at_begin_ = clocks_.queued();
  cpu_at_begin_ = cpu_at_part_ = clocks_.cpu();
  wall_at_begin_ = wall_at_part_ = clocks_.wall();
}

void LoopMeter::Part(std::string_view what) {
  if (turn_.empty() || part_ == what) return;
  ClosePart(clocks_.wall(), clocks_.cpu());
  part_ = what;
}

void LoopMeter::ClosePart(nanoseconds wall, nanoseconds cpu) {
  const nanoseconds part_wall = wall - wall_at_part_;
  Count(part_.empty() ? turn_ : part_, part_wall, cpu - cpu_at_part_);
  if (part_wall > longest_part_wall_) {
    longest_part_wall_ = part_wall;
    longest_part_ = part_;
  }
  wall_at_part_ = wall;
  cpu_at_part_ = cpu;
}

void LoopMeter::Count(std::string_view name, nanoseconds wall, nanoseconds cpu) {
  auto found = by_name_.find(name);
  if (found == by_name_.end()) found = by_name_.emplace(std::string(name), LoopFigures{}).first;
  Add(found->second, wall, cpu);
}

LoopTurn LoopMeter::Describe(nanoseconds wall, nanoseconds cpu) const {
  LoopTurn turn{.what = turn_, .wall = wall, .cpu = cpu, .queued = {}, .blocked = {}};
  if (!longest_part_.empty()) turn.what += ": " + longest_part_;
  turn.queued = std::clamp(clocks_.queued() - queued_at_begin_, nanoseconds{},
                           std::max(wall - cpu, nanoseconds{}));
  turn.blocked = std::max(wall - cpu - turn.queued, nanoseconds{});
  return turn;
}

void LoopMeter::End() {
  const nanoseconds cpu_now = clocks_.cpu(), wall_now = clocks_.wall();
  ClosePart(wall_now, cpu_now);
  const nanoseconds wall = wall_now - wall_at_begin_, cpu = cpu_now - cpu_at_begin_;
  Add(all_, wall, cpu);
  const bool is_slow = wall > kLimit, is_slow_by_cpu = cpu > kLimit;
  const bool is_longest = !longest_ || wall > longest_->wall,
             is_longest_cpu = !longest_cpu_ || cpu > longest_cpu_->cpu;
  if (is_slow || is_slow_by_cpu || is_longest || is_longest_cpu) {
    const LoopTurn turn = Describe(wall, cpu);
    if (is_longest) longest_ = turn;
    if (is_longest_cpu) longest_cpu_ = turn;
    if (is_slow_by_cpu) {
      SlowKind& kind = slow_kinds_[turn.what];
      kind.longest_part = longest_part_.empty() ? turn_ : longest_part_;
      ++kind.times;
    }
    if (is_slow) ReportSlow(turn, wall_now);
  }
  turn_.clear();
}

std::map<std::string, SlowTurns> LoopMeter::slow_turns() const {
  std::map<std::string, SlowTurns> turns;
  for (const auto& [what, kind] : slow_kinds_) {
    turns[what] = {.times = kind.times, .of = by_name_.at(kind.longest_part).count};
  }
  return turns;
}

void LoopMeter::ReportSlow(const LoopTurn& turn, nanoseconds now) {
  if (!slow_ || (reported_at_ && now - *reported_at_ < kReportInterval)) {
    ++unsaid_;
    return;
  }
  reported_at_ = now;
  slow_(turn, std::exchange(unsaid_, 0));
}

}  // namespace plumb
