// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/kept_clock.hpp"

#include <sys/timex.h>
#include <systemd/sd-bus.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <system_error>

namespace plumb {

namespace {

using std::chrono::steady_clock;

std::uint64_t LeftUntil_us(steady_clock::time_point end) {
  const auto left =
      std::chrono::duration_cast<std::chrono::microseconds>(end - steady_clock::now());
  return static_cast<std::uint64_t>(std::max<std::int64_t>(1, left.count()));
}

/// The timeout of a method call does not hold for the greeting of the bus before it.
bool IsReady(sd_bus* bus, steady_clock::time_point end) {
  while (sd_bus_is_ready(bus) == 0 && steady_clock::now() < end) {
    const int done = sd_bus_process(bus, nullptr);
    if (done < 0 || (done == 0 && sd_bus_wait(bus, LeftUntil_us(end)) < 0)) return false;
  }
  return sd_bus_is_ready(bus) > 0;
}

}  // namespace

bool IsKeptByTimedated(std::chrono::milliseconds patience) {
  constexpr const char* kName = "org.freedesktop.timedate1";
  const auto end = steady_clock::now() + patience;
  sd_bus* bus = nullptr;
  int is_kept = 0;
  const bool has_answer =
      sd_bus_open_system(&bus) >= 0 && IsReady(bus, end) &&
      sd_bus_set_method_call_timeout(bus, LeftUntil_us(end)) >= 0 &&
      sd_bus_get_property_trivial(bus, kName, "/org/freedesktop/timedate1", kName,
                                  "NTPSynchronized", nullptr, 'b', &is_kept) >= 0;
  sd_bus_close_unref(bus);
  return has_answer && is_kept != 0;
}

bool IsClockKept(const std::filesystem::path& note, const AskClock& ask) {
  std::error_code error;
  if (std::filesystem::exists(note, error)) return true;
  timex state{};  // no modes: nothing is set
  const int answer = ask.kernel(state);
  if (answer < 0) return ask.timedated();
  // The kernel sets the flag at its start, and again if no time server has corrected it for hours.
  return answer != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
}

}  // namespace plumb
