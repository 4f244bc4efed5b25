// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/virtual_scenes.hpp"

#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulator/player/frame_cache.hpp"
#include "drivers/simulator/player/kept_scenes.hpp"
#include "drivers/simulator/player/raw_frame.hpp"
#include "drivers/simulator/suites/board_scenes.hpp"
#include "drivers/simulator/suites/live_scenes.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "words/simulator.hpp"

namespace plumb {
namespace {

constexpr int kBoardScenes = 3;  // number of scenes that a room calibration needs

namespace fs = std::filesystem;
using simulated::FrameCacheReader;
using simulated::FrameCacheShape;
using simulated::MakeRaw;
using simulated::RawFrame;
using simulated::WriteRaw;

/// True if the file holds the scene as the present simulator renders it: same version, and an
/// identical first frame.
bool IsCurrent(const fs::path& file, const FrameCacheShape& shape, const RawFrame& first) try {
  const FrameCacheReader cache(file);
  if (cache.shape() != shape) return false;
  RawFrame cached;
  cached.rgb.resize(shape.color_bytes());
  cached.depth_mm.resize(shape.depth_bytes() / 2);
  cached.stamps = cache.Read(0, cached.rgb, cached.depth_mm);
  return cached == first;
} catch (const std::runtime_error&) {
  return false;
}

/// Removes incomplete files of killed processes, which may be half a gigabyte each.
void RemoveStale(const fs::path& folder) {
  constexpr std::string_view kMark = simulated::kPartialMark;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const std::size_t mark = name.find(kMark);
    if (mark == std::string::npos) continue;
    const int pid = std::atoi(name.c_str() + mark + kMark.size());
    if (pid > 0 && ::kill(pid, 0) != 0 && errno == ESRCH) fs::remove(entry.path(), error);
  }
}

/// The cache's folder, made if it is not there.
fs::path PrepareFolder(const VirtualSensorOptions& options) {
  const fs::path folder =
      options.cache_folder.empty() ? DefaultVirtualSensorCache() : options.cache_folder;
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw IoError(DescribeWriteError(folder, error.value()));
  RemoveStale(folder);
  return folder;
}

/// Renders the missing scenes into the cache.
class Renderer {
 public:
  Renderer(const VirtualSensorOptions& options, const SimulateOptions& simulate, fs::path folder)
      : options_(options),
        plan_(simulated::PlanSuite(simulate)),
        shape_{static_cast<std::uint32_t>(options.width),
               static_cast<std::uint32_t>(options.height),
               static_cast<std::uint32_t>(options.frames),
               static_cast<std::uint32_t>(std::lround(1e6 / options.rate_hz)),
               PLUMB_SIMULATOR_VERSION},
        folder_(std::move(folder)) {
    if (!options_.board_centres_m.empty())
      simulated::AddBoardScenes(plan_, options_.board_centres_m, kBoardScenes);
    num_sweeps_ = plan_.scenes.size();
    if (options_.max_scenes > 0) num_sweeps_ = std::min(num_sweeps_, options_.max_scenes);
    num_swept_ = plan_.scenes.size();
    if (options_.at_rest)
      simulated::AddRestLoops(
          plan_, simulate, num_sweeps_ - 1,
          {.with_second = !options_.second_serial.empty(), .with_steps = options_.rest_steps});
  }

  [[nodiscard]] const simulated::SuitePlan& plan() const { return plan_; }
  [[nodiscard]] std::size_t num_sweeps() const { return num_sweeps_; }
  /// Those after it are loops of a sensor at rest.
  [[nodiscard]] std::size_t num_swept() const { return num_swept_; }

  fs::path Prepare(std::size_t scene, const std::stop_token& stop,
                   const std::function<void(double)>& progress) const {
    const auto source = simulated::MakeSource(plan_, scene);
    const double start_s = source->sweep().start_time_s;
    const fs::path file =
        folder_ / fmt::format("{}-{}-seed{}{}-{}x{}-{}at{:g}hz-{}.frames", plan_.name,
                              static_cast<int>(options_.noise), options_.seed,
                              options_.room ? fmt::format("-room{}", *options_.room) : "",
                              options_.width, options_.height, options_.frames, options_.rate_hz,
                              NameInCache(scene));
    const RawFrame first = MakeRaw(source->Next().value(), start_s);
    FrameCacheShape shape = shape_;
    shape.num_frames = static_cast<std::uint32_t>(source->info().num_frames.value());
    if (IsCurrent(file, shape, first)) return file;
    fs::path beside = file;
    beside += fmt::format("{}{}", simulated::kPartialMark, ::getpid());
    FileWriter writer(beside);
    writer.Write(simulated::FrameCacheHeader(shape));
    WriteRaw(writer, first);
    double done = 1;
    while (const std::optional<Frame> frame = source->Next()) {
      WriteRaw(writer, MakeRaw(*frame, start_s));
      if (progress) progress(++done / shape.num_frames);
      if (stop.stop_requested()) throw Interrupted(say::simulator::RenderingStopped());
    }
    writer.Close();
    std::error_code error;
    fs::rename(beside, file, error);
    if (error) throw IoError(DescribeWriteError(file, error.value()));
    return file;
  }

 private:
  /// A loop shows the body of the last sweep, or on its way to that of the first: another one of
  /// the same name where other sweeps are shown.
  [[nodiscard]] std::string NameInCache(std::size_t scene) const {
    const std::string& name = plan_.scenes[scene].name;
    if (scene < num_swept_) return name;
    return fmt::format("{}-of-{}-{}", name, plan_.scenes.front().name,
                       plan_.scenes[num_sweeps_ - 1].name);
  }

  const VirtualSensorOptions& options_;
  simulated::SuitePlan plan_;
  std::size_t num_sweeps_ = 0, num_swept_ = 0;
  FrameCacheShape shape_;
  fs::path folder_;
};

}  // namespace

SimulateOptions ScenesOf(const VirtualSensorOptions& options) {
  const bool known_size = (options.width == 640 && options.height == 480) ||
                          (options.width == 848 && options.height == 480) ||
                          (options.width == 320 && options.height == 240);
  if (!known_size) throw std::invalid_argument("the virtual sensor is 640x480, 848x480 or 320x240");
  SimulateOptions simulate;
  simulate.suite = options.suite;
  simulate.seed = options.seed;
  simulate.room = options.room;
  simulate.noise = options.noise;
  simulate.faults = simulated::MildFaults(options.noise);
  simulate.frames = options.frames;
  simulate.rate_hz = options.rate_hz;
  simulate.width = options.width;
  simulate.height = options.height;
  return simulate;
}

fs::path DefaultVirtualSensorCache() {
  if (const char* cache = ::getenv("XDG_CACHE_HOME"); cache != nullptr && *cache == '/')
    return fs::path(cache) / "plumb/virtual-sensor";
  if (const char* home = ::getenv("HOME"); home != nullptr && *home == '/')
    return fs::path(home) / ".cache/plumb/virtual-sensor";
  return fs::temp_directory_path() / "plumb-virtual-sensor";
}

RenderedScenes RenderScenes(const VirtualSensorOptions& options, const std::stop_token& stop,
                            const SetUpProgress& progress) {
  const SimulateOptions simulate = ScenesOf(options);
  const fs::path folder = PrepareFolder(options);
  if (std::optional<RenderedScenes> kept = simulated::ReadKeptScenes(folder, options))
    return *std::move(kept);
  const Renderer renderer(options, simulate, folder);
  const auto& planned = renderer.plan().scenes;
  std::vector<std::size_t> wanted;
  for (std::size_t i = 0; i < renderer.num_sweeps(); ++i) wanted.push_back(i);
  for (std::size_t i = renderer.num_swept(); i < planned.size(); ++i) wanted.push_back(i);
  const auto camera_file = [&](std::size_t scene) {
    return CameraFileText(simulated::MakeSource(renderer.plan(), scene)->info(), 1000.0);
  };
  RenderedScenes scenes;
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const std::string& name = planned[wanted[k]].name;
    fs::path cache = renderer.Prepare(wanted[k], stop, [&](double fraction) {
      if (progress)
        progress((static_cast<double>(k) + fraction) / static_cast<double>(wanted.size()), name);
    });
    if (k >= renderer.num_sweeps()) {
      const bool is_second = name.starts_with("rest_second");
      (is_second ? scenes.second_at_rest : scenes.at_rest).push_back(std::move(cache));
      if (is_second) scenes.second_camera_file = camera_file(wanted[k]);
      continue;
    }
    scenes.names.push_back(name);
    scenes.caches.push_back(std::move(cache));
  }
  scenes.camera_file = camera_file(0);
  simulated::KeepScenes(folder, options, scenes);
  return scenes;
}

std::string AcceptedAnswer(std::string_view command, std::string answer) {
  if (!answer.starts_with("ok")) throw DeviceError(say::simulator::Refused(command, answer));
  answer.erase(0, answer.starts_with("ok ") ? 3 : 2);
  return answer;
}

}  // namespace plumb
