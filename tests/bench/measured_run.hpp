// SPDX-License-Identifier: Apache-2.0
// What the benchmark programs share: the cost of a piece of work, and a recording in memory.
#pragma once

#include <ctime>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "algo/types/frame.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {

/// Of all threads of this process.
inline double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

struct Cost {
  double cpu_s = 0, wall_s = 0;
};

inline Cost Measure(const std::function<void()>& work) {
  const double cpu_s = CpuSeconds(), wall_s = SteadySeconds();
  work();
  return {.cpu_s = CpuSeconds() - cpu_s, .wall_s = SteadySeconds() - wall_s};
}

/// A recording whose images have been decoded, so that decoding is not measured.
struct Recorded {
  StreamInfo info;
  std::vector<Frame> frames;
};

inline Recorded Load(const std::filesystem::path& recording) {
  const auto source = OpenTumRecording(recording);
  Recorded recorded;
  while (std::optional<Frame> frame = source->Next()) recorded.frames.push_back(std::move(*frame));
  recorded.info = source->info();
  return recorded;
}

}  // namespace plumb
