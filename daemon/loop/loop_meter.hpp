// SPDX-License-Identifier: Apache-2.0
// Measures how long the event loop's callbacks take, and on what they spend the time.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace plumb {

/// Resources used by a thread so far; only differences are meaningful.
struct LoopClocks {
  using Nanoseconds = std::chrono::nanoseconds;
  std::function<Nanoseconds()> wall;
  std::function<Nanoseconds()> cpu;     ///< Processor time of the thread alone.
  std::function<Nanoseconds()> queued;  ///< Time ready to run, but without a processor.
};

/// For the calling thread only. `queued` is constant where the kernel does not count it.
[[nodiscard]] LoopClocks ClocksOfThisThread();

/// One turn of the loop: a callback of a source, or one posted call.
struct LoopTurn {
  /// Name such as "tick"; for a turn with parts also the longest one: "http: GET /api/v1/scans".
  std::string what;
  std::chrono::nanoseconds wall{}, cpu{};
  std::chrono::nanoseconds queued{};  ///< Part of wall: waiting for a processor.
  std::chrono::nanoseconds
      blocked{};  ///< Part of wall: the rest, waiting for a disk, a lock or a pipe.
};

/// All turns of one kind, or all parts of one name.
struct LoopFigures {
  std::int64_t count = 0;
  std::int64_t over_limit = 0;  ///< By wall time.
  std::int64_t cpu_over_limit =
      0;  ///< By the thread's own processor time, which does not depend on other load.
  std::chrono::nanoseconds longest{}, longest_cpu{};
};

/// Turns of one kind that took over the limit by the thread's own processor time.
struct SlowTurns {
  std::int64_t times = 0;
  std::int64_t of = 0;  ///< How often what took longest in them was measured, slow or not.
};

/// Measures each turn, at a cost of about a microsecond. Used on the loop's thread.
class LoopMeter {
 public:
  static constexpr std::chrono::milliseconds kLimit{10};  ///< No turn should take longer.
  static constexpr std::chrono::minutes kReportInterval{1};
  /// @param unsaid  Turns over the limit since the last call that were not logged.
  using SlowListener = std::function<void(const LoopTurn& turn, std::int64_t unsaid)>;

  explicit LoopMeter(LoopClocks clocks = ClocksOfThisThread()) : clocks_(std::move(clocks)) {}

  /// Starts a turn.
  /// @param what  A string literal, never anything from outside, because names are kept.
  void Begin(std::string_view what);
  /// Attributes the turn from now on to this part; empty: to the rest. For turns that serve several
  /// requests; no effect outside a turn.
  void Part(std::string_view what);
  void End();

  /// Called at the end of a turn over the limit in wall time, at most once in kReportInterval.
  void SetSlowListener(SlowListener listener) { slow_ = std::move(listener); }

  [[nodiscard]] const LoopFigures& all() const { return all_; }
  /// The longest turns, by wall time and by processor time. Nothing before the first turn.
  [[nodiscard]] const std::optional<LoopTurn>& longest() const { return longest_; }
  [[nodiscard]] const std::optional<LoopTurn>& longest_cpu() const { return longest_cpu_; }
  /// By LoopTurn::what. What is slow by itself is so nearly each time; an interrupt, or a host that
  /// takes the processor away from a virtual machine, hits one turn of many.
  [[nodiscard]] std::map<std::string, SlowTurns> slow_turns() const;
  /// By name of source or part; the entry of a turn with parts counts the time between its parts.
  [[nodiscard]] const std::map<std::string, LoopFigures, std::less<>>& by_name() const {
    return by_name_;
  }

 private:
  void ClosePart(std::chrono::nanoseconds wall, std::chrono::nanoseconds cpu);
  void Count(std::string_view name, std::chrono::nanoseconds wall, std::chrono::nanoseconds cpu);
  [[nodiscard]] LoopTurn Describe(std::chrono::nanoseconds wall,
                                  std::chrono::nanoseconds cpu) const;
  void ReportSlow(const LoopTurn& turn, std::chrono::nanoseconds now);

  LoopClocks clocks_;
  SlowListener slow_;
  std::string turn_;  ///< Empty outside a turn.
  std::chrono::nanoseconds wall_at_begin_{}, cpu_at_begin_{}, queued_at_begin_{};
  std::string part_;  ///< Empty between the parts.
  std::chrono::nanoseconds wall_at_part_{}, cpu_at_part_{};
  std::string longest_part_;
  std::chrono::nanoseconds longest_part_wall_{};
  LoopFigures all_;
  std::optional<LoopTurn> longest_, longest_cpu_;
  struct SlowKind {
    std::string longest_part;  ///< As it is named in by_name_.
    std::int64_t times = 0;
  };
  std::map<std::string, SlowKind> slow_kinds_;
  std::map<std::string, LoopFigures, std::less<>> by_name_;
  std::optional<std::chrono::nanoseconds> reported_at_;
  std::int64_t unsaid_ = 0;
};

}  // namespace plumb
