// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/oni_recording.hpp"

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/files/reader_process.hpp"
#include "drivers/files/reader_program.hpp"
#include "drivers/openni/oni_file.hpp"
#include "drivers/openni/oni_protocol.hpp"
#include "drivers/program_folders.hpp"
#include "drivers/replay/camera_file.hpp"
#include "drivers/replay/registration.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxCameraBytes = std::size_t{1} << 16;
constexpr double kOniUnitsPerMetre = 1000.0;

fs::path ReaderProgram() {
  const std::optional<fs::path> program = FindBesideProgram("lib/plumb/plumb-oni-reader");
  if (!program) throw IoError(say::recording::ReaderMissing());
  return *program;
}

std::vector<std::string> Arguments(const fs::path& file, const OniBegin& begin) {
  return {file.string(), std::to_string(begin.color_us), std::to_string(begin.depth_us)};
}

Message HowItEnded(const ReaderProcess::End& end) {
  return end.crashed ? say::recording::OniCrashed(end.code) : say::recording::ReaderEnded(end.code);
}

class OniRecording : public FrameSource {
 public:
  OniRecording(fs::path file, const std::optional<std::string>& side_car,
               const RecordingDefaults& defaults)
      : file_(std::move(file)),
        side_car_(side_car),
        reader_(ReaderProgram(), Arguments(file_, ParseOniBegin(side_car_.value_or("")))) {
    ReadCamera(ReadHeader(), defaults);
  }
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override;

 private:
  [[noreturn]] void Fail(const Message& why) {
    finished_ = true;
    throw DataError(say::recording::OniDamaged(file_.string(), why));
  }

  void Read(void* data, std::size_t size) {
    switch (reader_.Read(data, size)) {
      case ReaderProcess::Got::kAll:
        return;
      case ReaderProcess::Got::kEnd:
        Fail(HowItEnded(reader_.Reap()));
      case ReaderProcess::Got::kSilence:
        Fail(say::recording::OniSilent(kReaderPatience.count()));
    }
  }
  template <typename Value>
  Value Read() {
    Value value{};
    Read(&value, sizeof value);
    return value;
  }

  [[noreturn]] void FailWithReaderError() {
    std::string text(std::min<std::size_t>(Read<std::uint32_t>(), kMaxReaderError), ' ');
    Read(text.data(), text.size());
    Fail(ReaderErrorOf(text));
  }

  oni::Header ReadHeader() {
    oni::Header header;
    header.magic = Read<std::uint32_t>();
    if (header.magic != oni::kMagic) Fail(say::recording::ReaderVersion());
    header.width = Read<std::int32_t>();
    if (header.width == static_cast<std::int32_t>(oni::Kind::kError))
      FailWithReaderError();  // no image is 3 pixels wide
    Read(&header.height, sizeof header - offsetof(oni::Header, height));
    if (header.width < 4 || header.width > kMaxImageSide || header.height < 4 ||
        header.height > kMaxImageSide)
      Fail(say::recording::OniImageSize(header.width, header.height));
    return header;
  }

  void ReadCamera(const oni::Header& header, const RecordingDefaults& defaults);
  void TakeDepthCamera(const CameraFile& camera);
  Frame ReadFrame();

  fs::path file_;
  std::optional<std::string> side_car_;  ///< Text of the side-car.
  ReaderProcess reader_;
  StreamInfo info_;
  std::optional<DepthRegistration> registration_;
  std::int64_t next_index_ = 0;
  double last_color_s_ = -1.0;
  double last_depth_s_ = -1.0;
  bool finished_ = false;
};

void OniRecording::ReadCamera(const oni::Header& header, const RecordingDefaults& defaults) {
  info_.room_markers = defaults.room_markers;
  info_.num_frames = header.num_frames;
  const fs::path side_car_file = OniSideCar(file_);
  if (side_car_) {
    const CameraFile camera = ParseCameraFile(*side_car_, side_car_file.string());
    if (camera.color.width != header.width || camera.color.height != header.height) {
      throw DataError(say::recording::SideCarSize(side_car_file.string(), camera.color.width,
                                                  camera.color.height, header.width,
                                                  header.height));
    }
    TakeOver(camera, info_);
    TakeDepthCamera(camera);
    info_.dictionary_assumed = !camera.room_markers.dictionary;
    info_.marker_length_assumed = !camera.room_markers.length_m;
  } else {
    info_.dictionary_assumed = info_.marker_length_assumed = true;
    info_.intrinsics = Resized(Intrinsics{}, header.width, header.height);
    if (header.horizontal_fov_rad > 0.2F && header.horizontal_fov_rad < 2.5F)
      info_.intrinsics.fx = info_.intrinsics.fy =
          0.5 * header.width / std::tan(0.5 * header.horizontal_fov_rad);
    info_.intrinsics_assumed = true;
    info_.warnings.push_back(
        say::recording::SideCarMissing(side_car_file.filename().string(), info_.intrinsics.fx));
  }
  if (info_.dictionary_assumed || info_.marker_length_assumed) {
    info_.warnings.push_back(
        say::recording::MarkersAssumed(info_.room_markers.dictionary, info_.room_markers.length_m));
  }
}

/// OpenNI2 gives millimetres, and both images in one size.
void OniRecording::TakeDepthCamera(const CameraFile& camera) {
  const std::string side_car = OniSideCar(file_).string();
  if (camera.depth_scale && *camera.depth_scale != kOniUnitsPerMetre)
    throw DataError(say::recording::OniUnit(side_car, *camera.depth_scale, kOniUnitsPerMetre));
  info_.depth_camera_unknown = camera.depth_camera_unknown;
  if (!camera.depth_camera) return;
  const Intrinsics& depth = camera.depth_camera->intrinsics;
  if (depth.width != camera.color.width || depth.height != camera.color.height)
    throw DataError(say::recording::SideCarSize(side_car, depth.width, depth.height,
                                                camera.color.width, camera.color.height));
  registration_.emplace(depth, camera.color, camera.depth_camera->T_color_depth);
}

Frame OniRecording::ReadFrame() {
  const auto stamps = Read<oni::FrameStamps>();
  Frame frame;
  frame.index = next_index_++;
  frame.color_time_s = 1e-6 * static_cast<double>(stamps.color_us);
  frame.depth_time_s = 1e-6 * static_cast<double>(stamps.depth_us);
  if (frame.color_time_s <= last_color_s_ || frame.depth_time_s <= last_depth_s_)
    Fail(say::recording::OniStamps());
  last_color_s_ = frame.color_time_s;
  last_depth_s_ = frame.depth_time_s;
  frame.color_rgb.create(info_.intrinsics.height, info_.intrinsics.width, CV_8UC3);
  Read(frame.color_rgb.data, frame.color_rgb.total() * frame.color_rgb.elemSize());
  cv::Mat depth_mm(info_.intrinsics.height, info_.intrinsics.width, CV_16UC1);
  Read(depth_mm.data, depth_mm.total() * depth_mm.elemSize());
  depth_mm.convertTo(frame.depth_m, CV_32F, 1.0 / kOniUnitsPerMetre);
  if (registration_) frame.depth_m = registration_->Register(frame.depth_m);
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
  Fail(say::recording::ReaderVersion());
}

}  // namespace

std::unique_ptr<FrameSource> OpenOniRecording(const fs::path& file,
                                              const RecordingDefaults& defaults) {
  std::error_code error;
  if (!fs::exists(file, error)) throw DataError(say::recording::OniMissing(file.string()));
  if (!IsOniFile(file)) throw DataError(say::recording::NotOni(file.string()));
  if (!(defaults.room_markers.length_m > 0 &&
        MarkerDictionary::Find(defaults.room_markers.dictionary)))
    throw std::invalid_argument("RecordingDefaults: marker length or dictionary out of range");
  std::optional<std::string> side_car;
  if (const fs::path name = OniSideCar(file); fs::exists(fs::symlink_status(name, error)))
    side_car = ReadTextFile(name, kMaxCameraBytes);
  return std::make_unique<OniRecording>(fs::absolute(file), side_car, defaults);
}

}  // namespace plumb
