#include "drivers/openni/oni_recording.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <string>

#include "algo/base/errors.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/openni/oni_file.hpp"
#include "drivers/openni/oni_protocol.hpp"
#include "drivers/program_folders.hpp"
#include "drivers/replay/camera_file.hpp"

extern char** environ;

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{30};  // timeout for a silent child
constexpr int kPipeBytes = 1 << 20;
constexpr std::size_t kMaxCameraBytes = std::size_t{1} << 16;

fs::path ReaderProgram() {
  const std::optional<fs::path> program = FindBesideProgram("lib/plumb/plumb-oni-reader");
  if (!program)
    throw IoError(
        "plumb-oni-reader is missing: expected lib/plumb/plumb-oni-reader in a folder above this "
        "program");
  return *program;
}

/// The child process and the end of its pipe.
class Reader {
 public:
  Reader(const fs::path& program, const fs::path& file, const OniBegin& begin) {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0)
      throw IoError(fmt::format("no pipe: {}", std::strerror(errno)));
    (void)::fcntl(ends[0], F_SETPIPE_SZ, kPipeBytes);
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    ::posix_spawn_file_actions_init(&actions);
    ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    ::posix_spawnattr_init(&attributes);
    sigset_t none;
    sigset_t defaults;
    ::sigemptyset(&none);
    ::sigemptyset(&defaults);
    ::sigaddset(&defaults, SIGPIPE);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setsigdefault(&attributes, &defaults);
    // In its own process group: Ctrl-C at the terminal reaches the parent only, which ends the
    // child.
    ::posix_spawnattr_setflags(
        &attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
    std::string name = program.string(), argument = file.string();
    std::string color = std::to_string(begin.color_us), depth = std::to_string(begin.depth_us);
    std::array<char*, 5> arguments{name.data(), argument.data(), color.data(), depth.data(),
                                   nullptr};
    const int error =
        ::posix_spawn(&pid_, name.c_str(), &actions, &attributes, arguments.data(), environ);
    ::posix_spawn_file_actions_destroy(&actions);
    ::posix_spawnattr_destroy(&attributes);
    ::close(ends[1]);
    descriptor_ = ends[0];
    if (error != 0) {
      pid_ = -1;
      ::close(descriptor_);
      throw IoError(fmt::format("cannot run {}: {}", name, std::strerror(error)));
    }
  }
  ~Reader() {
    ::close(descriptor_);
    if (pid_ < 0) return;
    ::kill(pid_, SIGKILL);
    (void)Reap();
  }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  enum class Got { kAll, kEnd, kSilence };
  Got Read(void* data, std::size_t size) {
    auto* to = static_cast<char*>(data);
    while (size > 0) {
      pollfd wait{descriptor_, POLLIN, 0};
      const int ready =
          ::poll(&wait, 1, static_cast<int>(std::chrono::milliseconds(kPatience).count()));
      if (ready < 0 && errno == EINTR) continue;
      if (ready <= 0) return Got::kSilence;
      const ssize_t got = ::read(descriptor_, to, size);
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return Got::kEnd;
      to += got;
      size -= static_cast<std::size_t>(got);
    }
    return Got::kAll;
  }

  /// How the child ended, once its pipe is closed.
  std::string Reap() {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    if (WIFSIGNALED(status))
      return fmt::format("OpenNI2 crashed on it (signal {})", WTERMSIG(status));
    return fmt::format("its reader ended early (exit code {})", WEXITSTATUS(status));
  }

 private:
  pid_t pid_ = -1;
  int descriptor_ = -1;
};

class OniRecording : public FrameSource {
 public:
  OniRecording(fs::path file, const std::optional<std::string>& side_car,
               const RecordingDefaults& defaults)
      : file_(std::move(file)),
        side_car_(side_car),
        reader_(ReaderProgram(), file_, ParseOniBegin(side_car_.value_or(""))) {
    ReadCamera(ReadHeader(), defaults);
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override;

 private:
  [[noreturn]] void Fail(const std::string& why) {
    finished_ = true;
    throw DataError(
        fmt::format("recording {} is damaged or not an .oni recording that Plumb can use: {}",
                    file_.string(), why));
  }

  void Read(void* data, std::size_t size) {
    switch (reader_.Read(data, size)) {
      case Reader::Got::kAll:
        return;
      case Reader::Got::kEnd:
        Fail(reader_.Reap());
      case Reader::Got::kSilence:
        Fail(fmt::format("OpenNI2 delivered nothing for {} s", kPatience.count()));
    }
  }
  template <typename Value>
  Value Read() {
    Value value{};
    Read(&value, sizeof value);
    return value;
  }

  [[noreturn]] void FailWithReaderError() {
    std::string text(std::min(Read<std::uint32_t>(), oni::kMaxText), ' ');
    Read(text.data(), text.size());
    Fail(text);
  }

  oni::Header ReadHeader() {
    oni::Header header;
    header.magic = Read<std::uint32_t>();
    if (header.magic != oni::kMagic) Fail("its reader has another version");
    header.width = Read<std::int32_t>();
    if (header.width == static_cast<std::int32_t>(oni::Kind::kError))
      FailWithReaderError();  // no image is 3 pixels wide
    Read(&header.height, sizeof header - offsetof(oni::Header, height));
    if (header.width < 4 || header.width > kMaxImageSide || header.height < 4 ||
        header.height > kMaxImageSide)
      Fail(fmt::format("its images are {}x{}", header.width, header.height));
    return header;
  }

  void ReadCamera(const oni::Header& header, const RecordingDefaults& defaults);
  Frame ReadFrame();

  fs::path file_;
  std::optional<std::string> side_car_;  ///< Text of the side-car.
  Reader reader_;
  StreamInfo info_;
  std::int64_t next_index_ = 0;
  double last_color_s_ = -1.0;
  double last_depth_s_ = -1.0;
  bool finished_ = false;
};

void OniRecording::ReadCamera(const oni::Header& header, const RecordingDefaults& defaults) {
  info_.marker_dictionary = defaults.marker_dictionary;
  info_.marker_length_m = defaults.marker_length_m;
  info_.reference_marker = defaults.reference_marker;
  info_.num_frames = header.num_frames;
  const fs::path side_car_file = OniSideCar(file_);
  bool markers_known = false;
  if (side_car_) {
    const CameraFile camera = ParseCameraFile(*side_car_, side_car_file.string());
    if (camera.color.width != header.width || camera.color.height != header.height) {
      throw DataError(fmt::format("{} is for images of {}x{}, the recording has {}x{}",
                                  side_car_file.string(), camera.color.width, camera.color.height,
                                  header.width, header.height));
    }
    TakeOver(camera, info_);
    markers_known = camera.marker_dictionary && camera.marker_length_m;
  } else {
    info_.intrinsics = Resized(Intrinsics{}, header.width, header.height);
    if (header.horizontal_fov_rad > 0.2F && header.horizontal_fov_rad < 2.5F)
      info_.intrinsics.fx = info_.intrinsics.fy =
          0.5 * header.width / std::tan(0.5 * header.horizontal_fov_rad);
    info_.intrinsics_assumed = true;
    info_.warnings.push_back(
        fmt::format("no {}: nominal focal length of {:.1f} pixels, no distortion and depth "
                    "registered to colour assumed",
                    side_car_file.filename().string(), info_.intrinsics.fx));
  }
  if (!markers_known) {
    info_.warnings.push_back(
        fmt::format("the recording does not state its markers: assumed {} with a side of {} m",
                    info_.marker_dictionary, info_.marker_length_m));
  }
}

Frame OniRecording::ReadFrame() {
  const auto stamps = Read<oni::FrameStamps>();
  Frame frame;
  frame.index = next_index_++;
  frame.color_time_s = 1e-6 * static_cast<double>(stamps.color_us);
  frame.depth_time_s = 1e-6 * static_cast<double>(stamps.depth_us);
  if (frame.color_time_s <= last_color_s_ || frame.depth_time_s <= last_depth_s_)
    Fail("its stamps do not increase");
  last_color_s_ = frame.color_time_s;
  last_depth_s_ = frame.depth_time_s;
  frame.color_rgb.create(info_.intrinsics.height, info_.intrinsics.width, CV_8UC3);
  Read(frame.color_rgb.data, frame.color_rgb.total() * frame.color_rgb.elemSize());
  cv::Mat depth_mm(info_.intrinsics.height, info_.intrinsics.width, CV_16UC1);
  Read(depth_mm.data, depth_mm.total() * depth_mm.elemSize());
  depth_mm.convertTo(frame.depth_m, CV_32F, 1e-3);
  return frame;
}

std::optional<Frame> OniRecording::Next() {
  if (finished_) return std::nullopt;
  switch (Read<oni::Kind>()) {
    case oni::Kind::kFrame:
      return ReadFrame();
    case oni::Kind::kEnd:
      finished_ = true;
      return std::nullopt;
    case oni::Kind::kError:
      FailWithReaderError();
  }
  Fail("its reader has another version");
}

}  // namespace

std::unique_ptr<FrameSource> OpenOniRecording(const fs::path& file,
                                              const RecordingDefaults& defaults) {
  std::error_code error;
  if (!fs::exists(file, error))
    throw DataError(
        fmt::format("no recording at '{}': expected an .oni file, found nothing", file.string()));
  if (!IsOniFile(file))
    throw DataError(fmt::format(
        "{} is not an .oni recording of OpenNI2: it does not begin with NI10", file.string()));
  if (!(defaults.marker_length_m > 0 && MarkerDictionary::Find(defaults.marker_dictionary)))
    throw std::invalid_argument("RecordingDefaults: marker length or dictionary out of range");
  std::optional<std::string> side_car;
  if (const fs::path name = OniSideCar(file); fs::exists(fs::symlink_status(name, error)))
    side_car = ReadTextFile(name, kMaxCameraBytes);
  return std::make_unique<OniRecording>(fs::absolute(file), side_car, defaults);
}

}  // namespace plumb
