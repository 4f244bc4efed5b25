// SPDX-License-Identifier: Apache-2.0
#include "daemon/storage/kept_clock.hpp"

#include <sys/timex.h>
#include <systemd/sd-bus.h>

#include <cstdint>
#include <system_error>

namespace plumb {

namespace {

constexpr std::uint64_t kPatience_us = 5'000'000;

/// In plumbd's sandbox (ProtectClock=) no process may ask the kernel; systemd-timedated answers
/// instead.
int AskTimedated(timex& state) {
  constexpr const char* kName = "org.freedesktop.timedate1";
  sd_bus* bus = nullptr;
  int is_kept = 0;
  const bool has_answer =
      sd_bus_open_system(&bus) >= 0 && sd_bus_set_method_call_timeout(bus, kPatience_us) >= 0 &&
      sd_bus_get_property_trivial(bus, kName, "/org/freedesktop/timedate1", kName,
                                  "NTPSynchronized", nullptr, 'b', &is_kept) >= 0;
  sd_bus_flush_close_unref(bus);
  state.status = is_kept != 0 ? 0 : STA_UNSYNC;
  return has_answer ? TIME_OK : -1;
}

int AskSystem(timex& state) {
  const int answer = ::adjtimex(&state);
  return answer < 0 ? AskTimedated(state) : answer;
}

}  // namespace

bool IsClockKept(const std::filesystem::path& note, const AskKernelClock& ask) {
  std::error_code error;
  if (std::filesystem::exists(note, error)) return true;
  timex state{};  // no modes: nothing is set
  const int answer = ask ? ask(state) : AskSystem(state);
  // The kernel sets the flag at its start, and again if no time server has corrected it for hours.
  return answer >= 0 && answer != TIME_ERROR && (state.status & STA_UNSYNC) == 0;
}

}  // namespace plumb
