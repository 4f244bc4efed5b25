#include "drivers/simulated/virtual_sensor.hpp"

#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/types/errors.hpp"
#include "drivers/program_folders.hpp"
#include "drivers/replay/file_io.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulated/frame_cache.hpp"
#include "drivers/simulated/suite.hpp"
#include "drivers/simulated/suite_plan.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using simulated::CachedStamps;
using simulated::FrameCacheReader;
using simulated::FrameCacheShape;

constexpr float kMaxDepth_mm = 9999.0F;  // The recorder of OpenNI2 damages depth at and above the stream's maximum of 10000.
constexpr std::chrono::seconds kAnswerTime{1};

struct RawFrame {
  CachedStamps stamps;
  std::vector<std::uint8_t> rgb;
  std::vector<std::uint16_t> depth_mm;
  bool operator==(const RawFrame& other) const {
    return stamps.color_us == other.stamps.color_us && stamps.depth_us == other.stamps.depth_us && rgb == other.rgb &&
           depth_mm == other.depth_mm;
  }
};

RawFrame Raw(const Frame& frame, double start_time_s) {
  RawFrame raw;
  raw.stamps = {std::llround((frame.color_time_s - start_time_s) * 1e6), std::llround((frame.depth_time_s - start_time_s) * 1e6)};
  raw.rgb.assign(frame.color_rgb.datastart, frame.color_rgb.dataend);
  raw.depth_mm.reserve(frame.depth_m.total());
  for (int y = 0; y < frame.depth_m.rows; ++y) {
    const auto* row = frame.depth_m.ptr<float>(y);
    for (int x = 0; x < frame.depth_m.cols; ++x) {
      const float millimetres = std::round(row[x] * 1000.0F);
      raw.depth_mm.push_back(millimetres <= kMaxDepth_mm ? static_cast<std::uint16_t>(millimetres) : 0);
    }
  }
  return raw;
}

template <typename Value>
std::span<const std::uint8_t> BytesOf(const Value* values, std::size_t count) {
  return {reinterpret_cast<const std::uint8_t*>(values), count * sizeof(Value)};
}

void Write(FileWriter& file, const RawFrame& raw) {
  file.Write(BytesOf(&raw.stamps, 1));
  file.Write(raw.rgb);
  file.Write(BytesOf(raw.depth_mm.data(), raw.depth_mm.size()));
}

/// True if the file holds the scene as the simulator renders it today: its first frame is the same to the bit.
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

/// Renders scenes into the cache, those that are missing.
class Renderer {
 public:
  Renderer(const VirtualSensorOptions& options, const SimulateOptions& simulate)
      : options_(options),
        plan_(simulated::PlanSuite(simulate)),
        shape_{static_cast<std::uint32_t>(options.width), static_cast<std::uint32_t>(options.height),
               static_cast<std::uint32_t>(options.frames), static_cast<std::uint32_t>(std::lround(1e6 / options.rate_hz))},
        folder_(options.cache_folder.empty() ? DefaultVirtualSensorCache() : options.cache_folder) {
    std::error_code error;
    fs::create_directories(folder_, error);
    if (error) throw IoError(DescribeWriteError(folder_, error.value()));
  }

  [[nodiscard]] const simulated::SuitePlan& plan() const { return plan_; }

  fs::path Prepare(std::size_t scene, const std::stop_token& stop, const std::function<void(double)>& progress) const {
    const auto source = simulated::MakeSource(plan_, scene);
    const double start_s = source->sweep().start_time_s;
    const fs::path file =
        folder_ / fmt::format("{}-{}-seed{}-{}x{}-{}at{:g}hz-{}.frames", plan_.name, static_cast<int>(options_.noise), options_.seed,
                              options_.width, options_.height, options_.frames, options_.rate_hz, plan_.scenes[scene].name);
    const RawFrame first = Raw(source->Next().value(), start_s);
    if (IsCurrent(file, shape_, first)) return file;
    fs::path beside = file;
    beside += fmt::format(".partial-{}", ::getpid());
    FileWriter writer(beside);
    writer.Write(simulated::FrameCacheHeader(shape_));
    Write(writer, first);
    double done = 1;
    while (const std::optional<Frame> frame = source->Next()) {
      Write(writer, Raw(*frame, start_s));
      if (progress) progress(++done / options_.frames);
      if (stop.stop_requested()) throw Interrupted("rendering of the virtual sensor's scenes was stopped; it starts again next time");
    }
    writer.Close();
    std::error_code error;
    fs::rename(beside, file, error);
    if (error) throw IoError(DescribeWriteError(file, error.value()));
    return file;
  }

 private:
  const VirtualSensorOptions& options_;
  simulated::SuitePlan plan_;
  FrameCacheShape shape_;
  fs::path folder_;
};

SimulateOptions Simulate(const VirtualSensorOptions& options) {
  const bool known_size = (options.width == 640 && options.height == 480) || (options.width == 320 && options.height == 240);
  if (!known_size) throw std::invalid_argument("the virtual sensor is 640x480 or 320x240");
  const auto is_plain = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_'; };
  if (options.serial.empty() || options.serial.size() > 64 || !std::all_of(options.serial.begin(), options.serial.end(), is_plain))
    throw std::invalid_argument("a virtual sensor's serial is 1 to 64 letters, digits, - and _");
  SimulateOptions simulate;
  simulate.suite = options.suite;
  simulate.seed = options.seed;
  simulate.noise = options.noise;
  simulate.frames = options.frames;
  simulate.rate_hz = options.rate_hz;
  simulate.width = options.width;
  simulate.height = options.height;
  return simulate;
}

/// A socket of our own to which answers come.
class AnswerSocket {
 public:
  AnswerSocket() : descriptor_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;  // No name: the kernel chooses one.
    if (descriptor_ < 0 || ::bind(descriptor_, reinterpret_cast<const sockaddr*>(&address), sizeof(sa_family_t)) != 0)
      throw DeviceError(fmt::format("virtual sensor: no socket to command it: {}", std::strerror(errno)));
  }
  ~AnswerSocket() { ::close(descriptor_); }
  AnswerSocket(const AnswerSocket&) = delete;
  AnswerSocket& operator=(const AnswerSocket&) = delete;
  [[nodiscard]] int get() const { return descriptor_; }

 private:
  int descriptor_;
};

}  // namespace

fs::path DefaultVirtualSensorCache() {
  if (const char* cache = ::getenv("XDG_CACHE_HOME"); cache != nullptr && *cache == '/') return fs::path(cache) / "plumb/virtual-sensor";
  if (const char* home = ::getenv("HOME"); home != nullptr && *home == '/') return fs::path(home) / ".cache/plumb/virtual-sensor";
  return fs::temp_directory_path() / "plumb-virtual-sensor";
}

fs::path FindVirtualSensorRuntime() {
  const std::optional<fs::path> found = FindBesideProgram("lib/plumb/virtual-sensor/libOpenNI2.so.0");
  if (!found)
    throw IoError(
        "the virtual sensor's driver is missing: expected lib/plumb/virtual-sensor/libOpenNI2.so.0 in a folder above this program; build "
        "the "
        "target plumb_virtual_sensor or install the component virtual_sensor");
  return *found;
}

VirtualSensor::VirtualSensor(const VirtualSensorOptions& options, const std::stop_token& stop,
                             const std::function<void(double, std::string_view)>& progress)
    : runtime_library_(options.runtime.empty() ? FindVirtualSensorRuntime() : options.runtime), frames_(options.frames) {
  const Renderer renderer(options, Simulate(options));
  const std::size_t total = renderer.plan().scenes.size();
  const std::size_t count = options.max_scenes == 0 ? total : std::min(total, options.max_scenes);
  std::vector<fs::path> caches;
  for (std::size_t i = 0; i < count; ++i) {
    scenes_.push_back(renderer.plan().scenes[i].name);
    caches.push_back(renderer.Prepare(i, stop, [&](double fraction) {
      if (progress) progress((static_cast<double>(i) + fraction) / static_cast<double>(count), scenes_.back());
    }));
  }

  std::string folder = (fs::temp_directory_path() / "plumb-virtual-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) throw IoError(DescribeWriteError(folder, errno));
  session_folder_ = folder;
  socket_ = session_folder_ / "sensor.sock";
  calibration_folder_ = session_folder_ / "calibration";
  try {
    WriteSession(options, caches);
    const auto source = simulated::MakeSource(renderer.plan(), 0);
    WriteWholeFile(calibration_folder_ / (options.serial + ".yaml"), CameraFileText(source->info(), 1000.0));
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(session_folder_, ignored);
    throw;
  }
  ::setenv("PLUMB_VIRTUAL_SENSOR", session_folder_.c_str(), 1);
}

VirtualSensor::~VirtualSensor() {
  ::unsetenv("PLUMB_VIRTUAL_SENSOR");
  std::error_code ignored;
  fs::remove_all(session_folder_, ignored);
}

void VirtualSensor::WriteSession(const VirtualSensorOptions& options, const std::vector<fs::path>& caches) const {
  std::error_code error;
  fs::create_directory(calibration_folder_, error);
  if (error) throw IoError(DescribeWriteError(calibration_folder_, error.value()));
  std::string text = fmt::format("serial {}\nplugged {}\n", options.serial, options.plugged ? 1 : 0);
  for (const fs::path& cache : caches) text += fmt::format("scene {}\n", fs::absolute(cache).string());
  WriteWholeFile(session_folder_ / "session", text);
}

std::string VirtualSensor::Command(std::string_view command) const {
  const AnswerSocket answers;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = socket_.string();
  if (path.size() >= sizeof address.sun_path) throw DeviceError(fmt::format("virtual sensor: the socket's path is too long: {}", path));
  std::memcpy(address.sun_path, path.data(), path.size());
  if (::sendto(answers.get(), command.data(), command.size(), 0, reinterpret_cast<const sockaddr*>(&address), sizeof address) < 0)
    throw DeviceError(fmt::format("virtual sensor does not listen ({}); is an OpenNiProvider of it open?", std::strerror(errno)));
  pollfd wait{answers.get(), POLLIN, 0};
  const int ready = ::poll(&wait, 1, static_cast<int>(std::chrono::milliseconds(kAnswerTime).count()));
  std::array<char, 512> buffer{};
  const ssize_t size = ready > 0 ? ::recv(answers.get(), buffer.data(), buffer.size(), 0) : -1;
  if (size < 0) throw DeviceError(fmt::format("virtual sensor did not answer \"{}\" within {} s", command, kAnswerTime.count()));
  std::string answer(buffer.data(), static_cast<std::size_t>(size));
  if (!answer.starts_with("ok")) throw DeviceError(fmt::format("virtual sensor, command \"{}\": {}", command, answer));
  answer.erase(0, answer.starts_with("ok ") ? 3 : 2);
  return answer;
}

}  // namespace plumb
