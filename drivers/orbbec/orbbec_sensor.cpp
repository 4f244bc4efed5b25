// SPDX-License-Identifier: Apache-2.0
#include "drivers/orbbec/orbbec_sensor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "words/recording.hpp"
#include "words/sdk.hpp"

namespace plumb::orbbec {
namespace {

// Images state their unit one by one. All are brought to this one, which none of the cameras is
// finer than, and in which 16 bits hold more than the usable range.
constexpr double kBoxUnit_m = 1e-4;

// Native modes of the Gemini and Astra lines, and of the Femto line with the narrow field of view.
const std::array kDepthSizes = {cv::Size(848, 480), cv::Size(640, 576), cv::Size(640, 480),
                                cv::Size(640, 400)};
const std::array kColorSizes = {cv::Size(848, 480), cv::Size(960, 540), cv::Size(1280, 720),
                                cv::Size(640, 480)};

/// The Astra 2 counts exposure in us, the others in units of 100 us, as UVC does.
double ExposureUnit_us(const std::string& name) {
  return name.find("Astra 2") == std::string::npos ? 100.0 : 1.0;
}

/// Depth without what does not fit: no measurement.
cv::Mat InBoxUnits(const cv::Mat& depth, double scale_mm) {
  const double factor = 1e-3 * scale_mm / kBoxUnit_m;
  if (std::abs(factor - 1.0) < 1e-6) return depth.clone();
  const double farthest = std::floor(65535.0 / factor);
  cv::Mat scaled;
  depth.convertTo(scaled, CV_16U, factor);
  if (farthest < 65535.0) scaled.setTo(0, depth > farthest);
  return scaled;
}

}  // namespace

OrbbecStreams::OrbbecStreams(std::shared_ptr<const OrbbecLibrary> library,
                             std::shared_ptr<Device> device, const SdkUnit& unit)
    : library_(std::move(library)),
      serial_(unit.serial),
      exposure_unit_us_(ExposureUnit_us(unit.name)),
      device_(std::move(device)),
      color_(Choose(StreamKind::kColor)),
      depth_(Choose(StreamKind::kDepth)) {
  SetBool(kPropertyLaser, true);
  SetBool(kPropertyColorAutoExposure, true);
  SetBool(kPropertyColorAutoWhiteBalance, true);
}

OrbbecStreams::~OrbbecStreams() {
  // Waits for the library's threads: Accept() is not called any more.
  for (const OrbbecStream* stream : {&color_, &depth_})
    (void)library_->Try(library_->sensor_stop, stream->sensor.get());
}

OrbbecStream OrbbecStreams::Choose(StreamKind kind) const {
  const bool is_color = kind == StreamKind::kColor;
  const Message what = say::sdk::NoStreams(OrbbecTitle().name, serial_);
  const OrbbecLibrary& library = *library_;
  OrbbecStream best;
  best.sensor = library.Own(library.Call(what, library.device_get_sensor, device_.get(),
                                         is_color ? kSensorColor : kSensorDepth),
                            library.delete_sensor);
  const auto list = library.Own(library.Call(what, library.sensor_get_stream_profile_list,
                                             static_cast<const Sensor*>(best.sensor.get())),
                                library.delete_stream_profile_list);
  const ProfileList* modes = list.get();
  const auto count = library.Call(what, library.stream_profile_list_get_count, modes);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto profile = library.Own(
        library.Call(what, library.stream_profile_list_get_profile, modes, static_cast<int>(i)),
        library.delete_stream_profile);
    const Profile* mode = profile.get();
    const int format = library.CallOr(-1, library.stream_profile_get_format, mode);
    const bool is_wanted =
        is_color ? format == kFormatRgb : format == kFormatY16 || format == kFormatZ16;
    if (!is_wanted || library.CallOr(0, library.video_stream_profile_get_fps, mode) != kSdkRate_hz)
      continue;
    const int width = library.CallOr(0, library.video_stream_profile_get_width, mode);
    const int height = library.CallOr(0, library.video_stream_profile_get_height, mode);
    const auto rank =
        is_color ? SdkRank(kColorSizes, width, height) : SdkRank(kDepthSizes, width, height);
    if (rank && (!best.profile || *rank < best.rank))
      best = {best.sensor, profile, width, height, *rank};
  }
  if (!best.profile)
    throw DeviceError(
        say::sdk::NoMode(serial_, is_color ? say::recording::Colour() : say::recording::Depth(),
                         kSdkRate_hz, OrbbecTitle().guide));
  return best;
}

void OrbbecStreams::SetBool(int property, bool value) const {
  if (library_->CallOr(false, library_->device_is_property_supported,
                       static_cast<const Device*>(device_.get()), property, kPermissionWrite))
    (void)library_->Try(library_->device_set_bool_property, device_.get(), property, value);
}

void OrbbecStreams::SetExposure(double exposure_us) const {
  SetBool(kPropertyColorAutoExposure, !(exposure_us > 0));
  if (!(exposure_us > 0)) return;
  const ObRange range = library_->CallOr(ObRange(), library_->device_get_int_property_range,
                                         device_.get(), kPropertyColorExposure);
  if (range.least > range.most || range.most <= 0) return;
  const auto wanted = static_cast<std::int32_t>(std::lround(exposure_us / exposure_unit_us_));
  (void)library_->Try(library_->device_set_int_property, device_.get(), kPropertyColorExposure,
                      std::clamp(wanted, range.least, range.most));
}

SdkLens OrbbecStreams::Lens(const OrbbecStream& stream, const Message& image) const {
  const Message what = say::sdk::NoCalibration(serial_);
  const Profile* profile = stream.profile.get();
  const ObIntrinsics camera =
      library_->Call(what, library_->video_stream_profile_get_intrinsic, profile);
  const ObDistortion d =
      library_->Call(what, library_->video_stream_profile_get_distortion, profile);
  if (camera.width != stream.width || camera.height != stream.height) throw DeviceError(what);
  SdkLens lens{.width = camera.width,
               .height = camera.height,
               .fx = camera.fx,
               .fy = camera.fy,
               .cx = camera.cx,
               .cy = camera.cy,
               .distortion = std::vector<double>(5, 0.0)};
  const std::array all = {d.k1, d.k2, d.p1, d.p2, d.k3, d.k4, d.k5, d.k6};
  const bool is_zero = std::ranges::all_of(all, [](float c) { return c == 0; });
  if (is_zero) return lens;
  lens.is_equidistant = d.model == kDistortionKannalaBrandt;
  const bool is_known = d.model > kDistortionNone && d.model <= kDistortionKannalaBrandt;
  if (!is_known || (lens.is_equidistant && stream.sensor == depth_.sensor))
    throw DeviceError(say::sdk::LensModel(image, serial_, d.model, OrbbecTitle().name));
  if (lens.is_equidistant)
    lens.distortion = {d.k1, d.k2, d.k3, d.k4};
  else
    lens.distortion.assign(all.begin(),
                           d.model == kDistortionBrownConradyK6 ? all.end() : all.begin() + 5);
  return lens;
}

SdkFactory OrbbecStreams::Factory() const {
  const ObExtrinsics pose =
      library_->Call(say::sdk::NoCalibration(serial_), library_->stream_profile_get_extrinsic_to,
                     static_cast<const Profile*>(depth_.profile.get()), color_.profile.get());
  using Rows = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  return {.color = Lens(color_, say::recording::Colour()),
          .depth = Lens(depth_, say::recording::Depth()),
          .T_color_depth =
              RigidPose(Eigen::Map<const Rows>(pose.rotation.data()),
                        1e-3F * Eigen::Map<const Eigen::Vector3f>(pose.translation.data())),
          .depth_unit_m = kBoxUnit_m};
}

void OrbbecStreams::Start(std::shared_ptr<FrameBox> box) {
  box_ = std::move(box);
  const FrameArrived on_frame = [](ObFrame* frame, void* self) {
    auto* streams = static_cast<OrbbecStreams*>(self);
    try {
      streams->Accept(frame);
    } catch (const std::exception& error) {  // The library is written in C++, but called as C.
      streams->box_->Fail(Message::Verbatim(error.what()));
    }
    (void)streams->library_->Try(streams->library_->delete_frame,
                                 static_cast<const ObFrame*>(frame));
  };
  for (const OrbbecStream* stream : {&depth_, &color_})
    library_->Call(say::sdk::NoStart(serial_), library_->sensor_start, stream->sensor.get(),
                   static_cast<const Profile*>(stream->profile.get()), on_frame,
                   static_cast<void*>(this));
}

void OrbbecStreams::Accept(const ObFrame* frame) {
  const Message what = say::sdk::BadImage(serial_);
  const OrbbecLibrary& library = *library_;
  const int type = library.Call(what, library.frame_get_type, frame);
  if (type != kFrameColor && type != kFrameDepth) return;
  const bool is_color = type == kFrameColor;
  const StreamKind kind = is_color ? StreamKind::kColor : StreamKind::kDepth;
  const OrbbecStream& mode = is_color ? color_ : depth_;
  box_->CountGaps(kind,
                  static_cast<std::int64_t>(library.Call(what, library.frame_get_index, frame)));
  const int format = library.Call(what, library.frame_get_format, frame);
  SdkImage image{
      .kind = kind,
      .width = static_cast<int>(library.Call(what, library.video_frame_get_width, frame)),
      .height = static_cast<int>(library.Call(what, library.video_frame_get_height, frame)),
      .has_format = is_color ? format == kFormatRgb : format == kFormatY16 || format == kFormatZ16,
      .data = library.Call(what, library.frame_get_data, frame)};
  // Rows follow each other; an image with too few bytes has another format.
  image.row_bytes = static_cast<std::size_t>(std::max(image.width, 0)) * (is_color ? 3 : 2);
  const std::size_t bytes = library.Call(what, library.frame_get_data_size, frame);
  image.has_format = image.has_format && image.height > 0 &&
                     bytes / static_cast<std::size_t>(image.height) >= image.row_bytes;
  if (!IsWanted(*box_, serial_, image, mode.width, mode.height)) return;
  const std::uint64_t stamp_us = library.Call(what, library.frame_get_timestamp_us, frame);
  if (stamp_us == 0 || stamp_us > std::uint64_t{1} << 60) return box_->CountDiscarded();
  cv::Mat copy = CopyOf(image);
  if (!is_color) {
    const auto scale_mm =
        static_cast<double>(library.Call(what, library.depth_frame_get_value_scale, frame));
    if (!(scale_mm > 1e-3 && scale_mm < 100.0)) return box_->Fail(what);
    copy = InBoxUnits(copy, scale_mm);
  }
  box_->Add(kind, static_cast<std::int64_t>(stamp_us), std::move(copy));
}

OrbbecSensor::OrbbecSensor(std::unique_ptr<OrbbecStreams> streams, SdkOpening opening,
                           const SensorSettings& settings)
    : SdkSensor(opening, settings, OrbbecTitle(), streams->Factory()),
      streams_(std::move(streams)) {
  opening.box->Begin(kSdkPairsToSettle);
  streams_->Start(std::move(opening.box));
}

void OrbbecSensor::LockExposure(bool locked) {
  if (exposure_us() > 0) streams_->SetExposure(locked ? exposure_us() : 0.0);
}

}  // namespace plumb::orbbec
