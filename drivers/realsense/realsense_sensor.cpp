// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_sensor.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <Eigen/Core>

#include "words/recording.hpp"
#include "words/sdk.hpp"

namespace plumb::realsense {
namespace {

constexpr float kLaser_mw = 150.0F;

// 848x480 is the native mode of the D400's stereo, in which its noise is lowest for the work.
const std::array kDepthSizes = {cv::Size(848, 480), cv::Size(640, 480), cv::Size(1024, 768)};
const std::array kColorSizes = {cv::Size(848, 480), cv::Size(960, 540), cv::Size(1280, 720),
                                cv::Size(640, 480)};

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
  const Message what = say::sdk::NoStreams(RealSenseTitle().name, serial_);
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
    throw DeviceError(
        say::sdk::NoMode(serial_, say::recording::Depth(), kSdkRate_hz, RealSenseTitle().guide));
  if (color_.profile == nullptr)
    throw DeviceError(
        say::sdk::NoMode(serial_, say::recording::Colour(), kSdkRate_hz, RealSenseTitle().guide));
}

void RealSenseStreams::Consider(Sensor* sensor, const Profile* profile) {
  int stream = 0, format = 0, index = 0, id = 0, rate_hz = 0;
  if (!library_->Try(library_->get_stream_profile_data, profile, &stream, &format, &index, &id,
                     &rate_hz) ||
      rate_hz != kSdkRate_hz)
    return;
  const bool is_depth = stream == kStreamDepth && format == kFormatZ16;
  const bool is_color = stream == kStreamColor && format == kFormatRgb8;
  ChosenMode found{.sensor = sensor, .profile = profile};
  if ((!is_depth && !is_color) ||
      !library_->Try(library_->get_video_stream_resolution, profile, &found.width, &found.height))
    return;
  const auto rank = is_depth ? SdkRank(kDepthSizes, found.width, found.height)
                             : SdkRank(kColorSizes, found.width, found.height);
  if (!rank) return;
  found.rank = *rank;
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

/// The library projects with its "inverse" and "modified" models as OpenCV does, but for the order
/// of the last two terms.
SdkLens RealSenseStreams::Lens(const RsIntrinsics& camera, const Message& image) const {
  constexpr std::array kPlain = {kDistortionNone, kDistortionModified, kDistortionInverse,
                                 kDistortionBrownConrady};
  const bool is_zero = std::ranges::all_of(camera.coefficients, [](float c) { return c == 0; });
  if (!is_zero && std::ranges::find(kPlain, camera.model) == kPlain.end())
    throw DeviceError(say::sdk::LensModel(image, serial_, camera.model, RealSenseTitle().name));
  return {.width = camera.width,
          .height = camera.height,
          .fx = camera.fx,
          .fy = camera.fy,
          .cx = camera.ppx,
          .cy = camera.ppy,
          .distortion = {camera.coefficients.begin(), camera.coefficients.end()}};
}

SdkFactory RealSenseStreams::Factory() const {
  const Message what = say::sdk::NoCalibration(serial_);
  RsIntrinsics color, depth;
  RsExtrinsics pose;
  library_->Call(what, library_->get_video_stream_intrinsics, color_.profile, &color);
  library_->Call(what, library_->get_video_stream_intrinsics, depth_.profile, &depth);
  library_->Call(what, library_->get_extrinsics, depth_.profile, color_.profile, &pose);
  const auto is_of = [](const RsIntrinsics& camera, const ChosenMode& mode) {
    return camera.width == mode.width && camera.height == mode.height;
  };
  if (!is_of(color, color_) || !is_of(depth, depth_)) throw DeviceError(what);
  return {.color = Lens(color, say::recording::Colour()),
          .depth = Lens(depth, say::recording::Depth()),
          .T_color_depth = RigidPose(Eigen::Map<const Eigen::Matrix3f>(pose.rotation.data()),
                                     Eigen::Map<const Eigen::Vector3f>(pose.translation.data())),
          .depth_unit_m =
              static_cast<double>(library_->Call(what, library_->get_depth_scale, depth_.sensor))};
}

void RealSenseStreams::Start(std::shared_ptr<FrameBox> box) {
  box_ = std::move(box);
  const Message what = say::sdk::NoStart(serial_);
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
          .frame_is_by_camera =
              library_->CallOr(kDomainHardwareClock, library_->get_frame_timestamp_domain, frame) ==
              kDomainHardwareClock,
          .exposure_us = metadata(kMetadataExposure)};
}

void RealSenseStreams::Accept(const RsFrame* frame) {
  const Message what = say::sdk::BadImage(serial_);
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
  const SdkImage image{.kind = kind,
                       .width = library_->Call(what, library_->get_frame_width, frame),
                       .height = library_->Call(what, library_->get_frame_height, frame),
                       .row_bytes = static_cast<std::size_t>(std::max(
                           0, library_->Call(what, library_->get_frame_stride_in_bytes, frame))),
                       .has_format = format == (is_color ? kFormatRgb8 : kFormatZ16),
                       .data = library_->Call(what, library_->get_frame_data, frame)};
  if (!IsWanted(*box_, serial_, image, mode.width, mode.height)) return;
  const std::optional<std::int64_t> stamp = stamps_.StampOf(kind, TimeOf(frame));
  if (const std::optional<StreamKind> lacking = stamps_.LacksClock())
    return box_->Fail(say::sdk::NoMetadata(
        *lacking == StreamKind::kColor ? say::recording::Colour() : say::recording::Depth(),
        serial_, RealSenseTitle().guide));
  if (!stamp) return box_->CountDiscarded();
  box_->Add(kind, *stamp, CopyOf(image));
}

RealSenseSensor::RealSenseSensor(std::unique_ptr<RealSenseStreams> streams, SdkOpening opening,
                                 const SensorSettings& settings)
    : SdkSensor(opening, settings, RealSenseTitle(), streams->Factory()),
      streams_(std::move(streams)) {
  opening.box->Begin(kSdkPairsToSettle);
  streams_->Start(std::move(opening.box));
}

void RealSenseSensor::LockExposure(bool locked) {
  if (exposure_us() > 0) streams_->SetExposure(locked ? exposure_us() : 0.0);
}

}  // namespace plumb::realsense
