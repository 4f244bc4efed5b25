// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_sensor.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <span>
#include <utility>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "drivers/live/sensor_calibration.hpp"
#include "drivers/replay/camera_file.hpp"
#include "words/realsense.hpp"
#include "words/recording.hpp"

namespace plumb::realsense {
namespace {

constexpr int kRate_hz = 30;
// Automatic exposure settles within half a second.
constexpr int kPairsToSettle = 15;
constexpr int kMostColumns = 960;
constexpr float kLaser_mw = 150.0F;

struct Size {
  int width, height;
};
// 848x480 is the native mode of the D400's stereo, in which its noise is lowest for the work.
constexpr std::array kDepthSizes = {Size{848, 480}, Size{640, 480}, Size{1024, 768}};
// Colour of more than 960 columns is halved.
constexpr std::array kColorSizes = {Size{848, 480}, Size{960, 540}, Size{1280, 720},
                                    Size{640, 480}};

cv::Size HalvedAbove(int width, int height) {
  return width > kMostColumns ? cv::Size(width / 2, height / 2) : cv::Size(width, height);
}

}  // namespace

RealSenseStreams::RealSenseStreams(std::shared_ptr<const RealSenseLibrary> library,
                                   std::shared_ptr<const Device> device, const std::string& serial)
    : library_(std::move(library)), serial_(serial), device_(std::move(device)) {
  FindModes();
  SetOptions();
}

RealSenseStreams::~RealSenseStreams() {
  // Waits for the library's threads: Accept() is not called any more.
  for (const Sensor* sensor : started_) (void)library_->Try(library_->stop, sensor);
  for (const Sensor* sensor : opened_) (void)library_->Try(library_->close, sensor);
}

void RealSenseStreams::FindModes() {
  const Message what = say::realsense::NoStreams(serial_);
  const Owned<SensorList> list(library_->Call(what, library_->query_sensors, device_.get()),
                               library_->delete_sensor_list);
  const int num_sensors = library_->Call(what, library_->get_sensors_count, list.get());
  for (int i = 0; i < num_sensors; ++i) {
    Sensor* sensor = sensors_
                         .emplace_back(library_->Call(what, library_->create_sensor, list.get(), i),
                                       library_->delete_sensor)
                         .get();
    const ProfileList* modes =
        profiles_
            .emplace_back(library_->Call(what, library_->get_stream_profiles, sensor),
                          library_->delete_stream_profiles_list)
            .get();
    const int num_modes = library_->Call(what, library_->get_stream_profiles_count, modes);
    for (int k = 0; k < num_modes; ++k)
      Consider(sensor, library_->Call(what, library_->get_stream_profile, modes, k));
  }
  if (depth_.profile == nullptr)
    throw DeviceError(say::realsense::NoMode(serial_, say::recording::Depth(), kRate_hz));
  if (color_.profile == nullptr)
    throw DeviceError(say::realsense::NoMode(serial_, say::recording::Colour(), kRate_hz));
}

void RealSenseStreams::Consider(Sensor* sensor, const Profile* profile) {
  int stream = 0, format = 0, index = 0, id = 0, rate_hz = 0;
  if (!library_->Try(library_->get_stream_profile_data, profile, &stream, &format, &index, &id,
                     &rate_hz) ||
      rate_hz != kRate_hz)
    return;
  const bool is_depth = stream == kStreamDepth && format == kFormatZ16;
  const bool is_color = stream == kStreamColor && format == kFormatRgb8;
  ChosenMode found{.sensor = sensor, .profile = profile};
  if ((!is_depth && !is_color) ||
      !library_->Try(library_->get_video_stream_resolution, profile, &found.width, &found.height))
    return;
  const std::span<const Size> sizes =
      is_depth ? std::span<const Size>(kDepthSizes) : std::span<const Size>(kColorSizes);
  const auto known = std::ranges::find_if(sizes, [&](const Size& size) {
    return size.width == found.width && size.height == found.height;
  });
  if (known == sizes.end()) return;
  found.rank = static_cast<std::size_t>(known - sizes.begin());
  ChosenMode& best = is_depth ? depth_ : color_;
  if (best.profile == nullptr || found.rank < best.rank) best = found;
}

/// Within the range of the option; an option that the camera does not have is left alone.
void RealSenseStreams::SetOption(const Sensor* sensor, int option, float value) const {
  if (library_->CallOr(0, library_->supports_option, sensor, option) == 0) return;
  float least = 0, most = 0, step = 0, usual = 0;
  if (!library_->Try(library_->get_option_range, sensor, option, &least, &most, &step, &usual) ||
      !(least <= most))
    return;
  (void)library_->Try(library_->set_option, sensor, option, std::clamp(value, least, most));
}

void RealSenseStreams::SetOptions() const {
  SetOption(depth_.sensor, kOptionPreset, kPresetHighAccuracy);  // First: it sets others.
  SetOption(depth_.sensor, kOptionEmitter, 1);
  SetOption(depth_.sensor, kOptionLaserPower, kLaser_mw);
  SetOption(depth_.sensor, kOptionAutoExposure, 1);
  SetOption(color_.sensor, kOptionAutoExposure, 1);
  SetOption(color_.sensor, kOptionAutoWhiteBalance, 1);
  // Else the rate falls in a dark room.
  SetOption(color_.sensor, kOptionAutoExposurePriority, 0);
  // Stamps by the computer's clock jitter with the bus.
  for (const Sensor* sensor : {depth_.sensor, color_.sensor})
    SetOption(sensor, kOptionGlobalTime, 0);
}

void RealSenseStreams::SetExposure(double exposure_us) const {
  SetOption(color_.sensor, kOptionAutoExposure, exposure_us > 0 ? 0 : 1);
  if (!(exposure_us > 0)) return;
  // A colour camera of its own counts in units of 100 us, as UVC does; the stereo module in us.
  const double unit_us = color_.sensor == depth_.sensor ? 1.0 : 100.0;
  SetOption(color_.sensor, kOptionExposure, static_cast<float>(exposure_us / unit_us));
}

cv::Size RealSenseStreams::color_size() const { return HalvedAbove(color_.width, color_.height); }

/// The library projects with its "inverse" and "modified" models as OpenCV does, but for the order
/// of the last two terms.
nlohmann::json RealSenseStreams::Lens(const RsIntrinsics& camera, const Message& image) const {
  constexpr std::array kPlain = {kDistortionNone, kDistortionModified, kDistortionInverse,
                                 kDistortionBrownConrady};
  const bool is_zero = std::ranges::all_of(camera.coefficients, [](float c) { return c == 0; });
  if (!is_zero && std::ranges::find(kPlain, camera.model) == kPlain.end())
    throw DeviceError(say::realsense::LensModel(image, serial_, camera.model));
  return camera.coefficients;
}

nlohmann::json RealSenseStreams::CameraKeys() const {
  const Message what = say::realsense::NoCalibration(serial_);
  RsIntrinsics color, depth;
  RsExtrinsics pose;
  library_->Call(what, library_->get_video_stream_intrinsics, color_.profile, &color);
  library_->Call(what, library_->get_video_stream_intrinsics, depth_.profile, &depth);
  library_->Call(what, library_->get_extrinsics, depth_.profile, color_.profile, &pose);
  const auto is_of = [](const RsIntrinsics& camera, const ChosenMode& mode) {
    return camera.width == mode.width && camera.height == mode.height;
  };
  if (!is_of(color, color_) || !is_of(depth, depth_)) throw DeviceError(what);
  const double unit_m =
      static_cast<double>(library_->Call(what, library_->get_depth_scale, depth_.sensor));
  if (!(unit_m > 0)) throw DeviceError(what);
  const auto matrix = [](const RsIntrinsics& c) {
    return std::array<double, 9>{c.fx, 0, c.ppx, 0, c.fy, c.ppy, 0, 0, 1};
  };
  const Eigen::Matrix3d turn =
      Eigen::Map<const Eigen::Matrix3f>(pose.rotation.data()).cast<double>();
  Pose T_color_depth = Pose::Identity();  // Single precision is not rigid enough.
  T_color_depth.linear() = Eigen::Quaterniond(turn).normalized().toRotationMatrix();
  T_color_depth.translation() =
      Eigen::Map<const Eigen::Vector3f>(pose.translation.data()).cast<double>();
  nlohmann::json rows = nlohmann::json::array();
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) rows.push_back(T_color_depth.matrix()(r, c));
  return {{"image_width", color.width},
          {"image_height", color.height},
          {"camera_matrix", matrix(color)},
          {"distortion_coefficients", Lens(color, say::recording::Colour())},
          {"depth_scale", 1.0 / unit_m},
          {"depth_registered", 0},
          {"depth_image_width", depth.width},
          {"depth_image_height", depth.height},
          {"depth_camera_matrix", matrix(depth)},
          {"depth_distortion_coefficients", Lens(depth, say::recording::Depth())},
          {"T_color_depth", rows}};
}

void RealSenseStreams::Start(std::shared_ptr<FrameBox> box) {
  box_ = std::move(box);
  const Message what = say::realsense::NoStart(serial_);
  std::array<const Profile*, 2> both = {depth_.profile, color_.profile};
  const bool is_one = depth_.sensor == color_.sensor;  // The D405.
  const auto open = [&](Sensor* sensor, const Profile** first, int count) {
    library_->Call(what, library_->open_multiple, sensor, first, count);
    opened_.push_back(sensor);
  };
  open(depth_.sensor, both.data(), is_one ? 2 : 1);
  if (!is_one) open(color_.sensor, &both[1], 1);
  const FrameArrived on_frame = [](RsFrame* frame, void* self) {
    auto* streams = static_cast<RealSenseStreams*>(self);
    try {
      streams->Accept(frame);
    } catch (const std::exception& error) {  // The library is written in C++, but called as C.
      streams->box_->Fail(Message::Verbatim(error.what()));
    }
    streams->library_->release_frame(frame);
  };
  for (const Sensor* sensor : opened_) {
    library_->Call(what, library_->start, sensor, on_frame, static_cast<void*>(this));
    started_.push_back(sensor);
  }
}

StatedTime RealSenseStreams::TimeOf(const RsFrame* frame) const {
  const auto metadata = [&](int which) -> std::optional<std::int64_t> {
    if (library_->CallOr(0, library_->supports_frame_metadata, frame, which) == 0)
      return std::nullopt;
    const auto value =
        library_->CallOr(std::int64_t{-1}, library_->get_frame_metadata, frame, which);
    return value < 0 ? std::nullopt : std::optional(value);
  };
  return {.sensor_us = metadata(kMetadataSensorTimestamp),
          .frame_ms = library_->CallOr(-1.0, library_->get_frame_timestamp, frame),
          .exposure_us = metadata(kMetadataExposure)};
}

void RealSenseStreams::Accept(const RsFrame* frame) {
  const Message what = say::realsense::BadImage(serial_);
  const Profile* profile = library_->Call(what, library_->get_frame_stream_profile, frame);
  int stream = 0, format = 0, index = 0, id = 0, rate_hz = 0;
  library_->Call(what, library_->get_stream_profile_data, profile, &stream, &format, &index, &id,
                 &rate_hz);
  if (stream != kStreamDepth && stream != kStreamColor) return;
  const bool is_color = stream == kStreamColor;
  const StreamKind kind = is_color ? StreamKind::kColor : StreamKind::kDepth;
  const ChosenMode& mode = is_color ? color_ : depth_;
  box_->CountGaps(
      kind, static_cast<std::int64_t>(library_->Call(what, library_->get_frame_number, frame)));
  const int width = library_->Call(what, library_->get_frame_width, frame);
  const int height = library_->Call(what, library_->get_frame_height, frame);
  const int stride = library_->Call(what, library_->get_frame_stride_in_bytes, frame);
  const void* data = library_->Call(what, library_->get_frame_data, frame);
  if (width != mode.width || height != mode.height || stride < width * (is_color ? 3 : 2) ||
      format != (is_color ? kFormatRgb8 : kFormatZ16) || data == nullptr) {
    box_->Fail(say::realsense::WrongSize(
        serial_, is_color ? say::recording::Colour() : say::recording::Depth(), width, height,
        mode.width, mode.height));
    return;
  }
  const std::optional<std::int64_t> stamp = stamps_.StampOf(kind, TimeOf(frame));
  if (!stamp) return box_->CountDiscarded();
  // The library takes its buffer back.
  const cv::Mat view(height, width, is_color ? CV_8UC3 : CV_16UC1, const_cast<void*>(data),
                     static_cast<std::size_t>(stride));
  cv::Mat image;
  if (is_color && color_size() != view.size())
    cv::resize(view, image, color_size(), 0, 0, cv::INTER_AREA);
  else
    image = view.clone();
  box_->Add(kind, *stamp, std::move(image));
}

namespace {

/// The factory's calibration, in the form of camera.yaml and as strictly checked.
CameraFile FactoryCamera(const RealSenseStreams& streams, const std::string& serial) try {
  return ParseCameraFile(streams.CameraKeys().dump(), "librealsense2");
} catch (const DataError& error) {
  throw DeviceError(say::realsense::CalibrationDamaged(serial, error.message()));
}

StreamInfo InfoFor(const SensorSettings& settings, const RealSenseUnit& unit,
                   const CameraFile& factory, cv::Size size) {
  const DepthSensor sensor = ClassOfLine(unit.line);
  StreamInfo info;
  std::error_code error;
  if (std::filesystem::exists(CalibrationFile(settings.calibration_folder, unit.serial), error)) {
    info =
        LiveStreamInfo(settings, unit.serial, size.width, size.height, 0.0, ClassOf(sensor).noise);
    if (info.usable_depth == UsableDepth()) info.usable_depth = ClassOf(sensor).range;
  } else {
    info.room_markers = settings.room_markers;
    TakeOver(factory, info);
    info.intrinsics = Resized(factory.color, size.width, size.height);
    info.depth_noise = ClassOf(sensor).noise;
    info.usable_depth = ClassOf(sensor).range;
  }
  info.depth_sensor = sensor;
  if (const auto advice = FirmwareAdvice(unit)) info.warnings.push_back(*advice);
  return info;
}

}  // namespace

RealSenseSensor::RealSenseSensor(std::unique_ptr<RealSenseStreams> streams,
                                 const RealSenseUnit& unit, const SensorSettings& settings,
                                 SensorDescription description, std::shared_ptr<FrameBox> box,
                                 std::shared_ptr<const void> watched)
    : BoxedSensor(std::move(description), box),
      exposure_us_(settings.exposure_us),
      streams_(std::move(streams)),
      watched_(std::move(watched)) {
  const CameraFile factory = FactoryCamera(*streams_, unit.serial);
  SetInfo(InfoFor(settings, unit, factory, streams_->color_size()));
  SetDepth(factory.depth_scale.value(),
           DepthRegistration(factory.depth_camera.value().intrinsics, info().intrinsics,
                             factory.depth_camera->T_color_depth));
  box->Begin(kPairsToSettle);
  streams_->Start(std::move(box));
}

void RealSenseSensor::LockExposure(bool locked) {
  if (exposure_us_ > 0) streams_->SetExposure(locked ? exposure_us_ : 0.0);
}

}  // namespace plumb::realsense
