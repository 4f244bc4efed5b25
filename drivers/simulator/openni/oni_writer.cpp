// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/openni/oni_writer.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>
#include <thread>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/openni/oni_recorder.hpp"
#include "drivers/openni/openni_provider.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulator/openni/virtual_session.hpp"
#include "drivers/simulator/player/raw_frame.hpp"
#include "words/simulator.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kPoll{10};
constexpr std::uint32_t kPeriod_us =
    33333;  // of the unit that plays; the stamps are those of the frames
constexpr std::chrono::seconds kNoProgress{20};

/// Removes a file at the end.
struct Remover {
  ~Remover() {
    std::error_code ignored;
    fs::remove(path, ignored);
  }
  fs::path path;
};

struct Spooled {
  std::uint32_t num_frames = 0;
  std::int64_t begin_us = 0;  ///< Stamp that is 0 in the spooled stamps.
  OniBegin first;             ///< Stamps of the first frame.
};

/// Writes the source's frames as a frame cache.
Spooled Spool(const fs::path& file, FrameSource& source, const std::stop_token& stop,
              const std::function<void()>& each) {
  const Intrinsics& camera = source.info().intrinsics;
  simulated::FrameCacheShape shape;
  shape.width = static_cast<std::uint32_t>(camera.width);
  shape.height = static_cast<std::uint32_t>(camera.height);
  shape.period_us = kPeriod_us;
  FileWriter writer(file);
  // written again below with the number of frames
  writer.Write(simulated::FrameCacheHeader(shape));
  double begin_s = 0;
  OniBegin first;
  while (const std::optional<Frame> frame = source.Next()) {
    if (shape.num_frames++ == 0) begin_s = std::max(0.0, std::floor(frame->color_time_s) - 1.0);
    const simulated::RawFrame raw = simulated::MakeRaw(*frame, begin_s);
    if (shape.num_frames == 1) first = {raw.stamps.color_us, raw.stamps.depth_us};
    simulated::WriteRaw(writer, raw);
    if (each) each();
    if (stop.stop_requested()) throw Interrupted(say::simulator::WritingStopped());
  }
  writer.Close();
  if (shape.num_frames == 0) throw DataError(say::simulator::NoFrame());
  std::fstream header(file, std::ios::in | std::ios::out | std::ios::binary);
  const std::string text = simulated::FrameCacheHeader(shape);
  if (!header.write(text.data(), static_cast<std::streamsize>(text.size())).flush())
    throw IoError(DescribeWriteError(file, errno));
  const std::int64_t begin_us = std::llround(begin_s * 1e6);
  return {shape.num_frames, begin_us, {begin_us + first.color_us, begin_us + first.depth_us}};
}

/// Waits until the virtual sensor has delivered its last frame.
void WaitForLast(const VirtualSession& session, std::uint32_t num_frames,
                 const std::stop_token& stop) {
  const std::string last = fmt::format(" position={}", num_frames - 1);
  std::string state;
  auto changed = std::chrono::steady_clock::now();
  while (!state.ends_with(last)) {
    if (stop.stop_requested()) throw Interrupted(say::simulator::WritingStopped());
    if (std::chrono::steady_clock::now() - changed > kNoProgress)
      throw DeviceError(say::simulator::SensorStopped(state));
    std::this_thread::sleep_for(kPoll);
    std::string now = session.Command("state");
    if (now != state) changed = std::chrono::steady_clock::now();
    state = std::move(now);
  }
}

}  // namespace

void WriteOni(const fs::path& file, FrameSource& source, const std::stop_token& stop,
              const std::function<void()>& each, bool jpeg) {
  const Remover spool{fs::path(file.string() + ".frames")};
  const Spooled spooled = Spool(spool.path, source, stop, each);
  VirtualSession::Contents contents;
  contents.serial = "SIMULATED";
  contents.scenes = {spool.path};
  contents.camera_file = CameraFileText(source.info(), 1000.0);
  const VirtualSession session(contents);
  OpenNiOptions options;
  options.library = FindVirtualSensorRuntime();
  options.calibration_folder = session.calibration_folder();
  options.markers_are_the_rooms = false;
  OpenNiProvider provider(options);
  OniFileSummary written;
  {
    // Static frames from before the sweep must not be recorded, so none are delivered until the
    // recorder runs.
    const std::unique_ptr<LiveSensor> sensor = provider.Open("");
    (void)session.Command("stall");
    OniRecorder recorder(*sensor, file, {.jpeg = jpeg});
    (void)session.Command(
        "speed 4");  // the disk keeps up with that; the rest is buffered in memory
    (void)session.Command(fmt::format("rewind once {}", spooled.begin_us));
    WaitForLast(session, spooled.num_frames, stop);
    written = recorder.Finish(spooled.first);
  }
  if (written.color_us.size() != spooled.num_frames ||
      written.depth_us.size() != spooled.num_frames) {
    std::error_code ignored;
    fs::remove(file, ignored);
    fs::remove(OniSideCar(file), ignored);
    throw IoError(say::simulator::ImagesLost(file.string(), written.color_us.size(),
                                             written.depth_us.size(), spooled.num_frames));
  }
}

}  // namespace plumb
