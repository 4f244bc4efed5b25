// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/ros_recording.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include <Eigen/Geometry>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "drivers/importers/ros_image.hpp"
#include "drivers/importers/ros_topics.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

using nlohmann::ordered_json;

constexpr double kMicro = 1e-6;
constexpr std::size_t kMostCameras = 64;
constexpr std::size_t kMostFrames = 1000;

/// One image, where its pixels are, and what is known of its time.
struct Listed {
  RosMessage message;
  double header_s = 0.0;
  std::optional<double> sensor_us = {};  ///< Mid-exposure, by the sensor's clock.
  std::optional<double> frame_us = {}, exposure_us = {};
  [[nodiscard]] std::optional<double> mid_us() const {
    if (sensor_us) return sensor_us;
    if (frame_us && exposure_us) return *frame_us - 0.5 * *exposure_us;
    return std::nullopt;
  }
};

struct RosStream {
  std::string topic;  ///< Such as /device_0/sensor_0/Depth_0; empty: not there.
  bool is_cdr = false, is_packed = false;
  std::string frame;  ///< Of reference, as ROS's drivers name it.
  std::optional<RosCamera> camera;
  std::optional<Eigen::Isometry3d> from_reference;
  bool is_depth = false;
  bool is_named_grey = false;  ///< Of depth: so named, as infrared images are.
  std::optional<double> unit_m = {};
  std::vector<Listed> images;
};

/// Turns a counter of 32 bits, which starts again after 71 minutes, into one that does not.
class Unwrapped {
 public:
  double operator()(double us) {
    constexpr double kTurn = 4294967296.0;
    if (last_ && us + turns_ * kTurn < *last_ - kTurn / 2) turns_ += 1;
    last_ = us + turns_ * kTurn;
    return *last_;
  }

 private:
  std::optional<double> last_;
  double turns_ = 0;
};

/// Where frames of reference are, as /tf_static states it.
class StaticFrames {
 public:
  /// tf2_msgs/TFMessage.
  void Note(RosReader reader) {
    const auto count = reader.Get<std::uint32_t>();
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::string parent(reader.TakeHeader().frame);
      const std::string child(reader.Text());
      std::array<double, 7> v{};
      for (double& value : v) value = reader.Get<double>();
      if (frames_.size() >= kMostFrames) return;
      frames_.insert_or_assign(Plain(child), Placed{Plain(parent), PoseOf(v)});
    }
  }
  /// Maps the frame to the other; nothing if they do not hang together.
  [[nodiscard]] std::optional<Eigen::Isometry3d> Between(const std::string& from,
                                                         const std::string& to) const {
    const auto [from_root, T_from] = RootOf(Plain(from));
    const auto [to_root, T_to] = RootOf(Plain(to));
    if (from_root != to_root) return std::nullopt;
    return T_to.inverse() * T_from;
  }
  /// A translation and a quaternion x y z w.
  static Eigen::Isometry3d PoseOf(const std::array<double, 7>& v) {
    const Eigen::Quaterniond turn(v[6], v[3], v[4], v[5]);
    if (!(std::abs(turn.norm() - 1.0) < 1e-3)) throw DataError(say::foreign::Rotation());
    return Eigen::Translation3d(v[0], v[1], v[2]) * turn.normalized();
  }

 private:
  struct Placed {
    std::string parent;
    Eigen::Isometry3d T_parent_frame;
  };
  /// ROS 1 may write a slash before the name.
  static std::string Plain(const std::string& name) {
    return name.starts_with('/') ? name.substr(1) : name;
  }
  [[nodiscard]] std::pair<std::string, Eigen::Isometry3d> RootOf(std::string frame) const {
    Eigen::Isometry3d T_root_frame = Eigen::Isometry3d::Identity();
    for (std::size_t step = 0; step < kMostFrames; ++step) {  // A hostile file may have a ring.
      const auto found = frames_.find(frame);
      if (found == frames_.end()) break;
      T_root_frame = found->second.T_parent_frame * T_root_frame;
      frame = found->second.parent;
    }
    return {frame, T_root_frame};
  }

  std::map<std::string, Placed> frames_;
};

class RosRecording : public RecordedFile {
 public:
  explicit RosRecording(std::unique_ptr<RosMessages> messages) : messages_(std::move(messages)) {
    facts_.format = messages_->format();
    messages_->ForEach([this](const RosTopic& topic, const RosMessage& message,
                              std::span<const std::uint8_t> data) { Note(topic, message, data); });
    ChooseStreams();
    TakeRosCameras();
    CheckStreams();
    StateCamera();
    SetStamps();
  }
  [[nodiscard]] const RecordedFacts& facts() const override { return facts_; }
  [[nodiscard]] cv::Mat Color(std::size_t i) override { return ColorOf(ImageOf(color_, i)); }
  [[nodiscard]] cv::Mat Depth(std::size_t i) override { return DepthOf(ImageOf(depth_, i)); }

 private:
  [[nodiscard]] RosImage ImageOf(const RosStream& stream, std::size_t i) {
    return ParseRosImage(RosReader(messages_->Read(stream.images.at(i).message), stream.is_cdr),
                         stream.is_packed);
  }
  void Note(const RosTopic& topic, const RosMessage& message, std::span<const std::uint8_t> data);
  void NoteStream(RosStream& stream, std::string_view rest, const RosMessage& message,
                  RosReader reader);
  void NoteDevice(RosReader reader);
  void NoteRos(const RosTopic& topic, const RosMessage& message, RosReader reader);
  void NoteRosImage(const RosTopic& topic, const RosMessage& message, RosReader reader);
  RosStream* CandidateOf(const RosTopic& topic, const RosImage& image, bool is_depth);
  void ChooseStreams();
  void TakeRosCameras();
  void GuessClass();
  void CheckStreams() const;
  void StateCamera();
  void StateDepthCamera();
  void SetStamps();

  std::unique_ptr<RosMessages> messages_;
  RecordedFacts facts_;
  RosStream color_, depth_;
  std::optional<double> depth_unit_m_;
  std::map<std::string, RosCamera, std::less<>> ros_cameras_;  ///< By the parent of their topic.
  std::vector<RosStream> candidates_;  ///< Topics of ROS's drivers, in the order of the file.
  std::size_t num_candidates_images_ = 0;
  StaticFrames frames_;
  bool is_aligned_ = false;  ///< Depth is registered to colour: a ROS driver did that.
};

/// Whether the topic belongs to the first stream of this kind; `rest` is then what follows the
/// stream's own part of the topic.
bool Belongs(std::string_view topic, std::string_view kind, RosStream& stream,
             std::string_view& rest) {
  const std::size_t begin = topic.find(kind);
  if (begin == std::string_view::npos) return false;
  const std::size_t end = topic.find('/', begin + 1);
  if (end == std::string_view::npos) return false;
  if (stream.topic.empty()) stream.topic = topic.substr(0, end);
  if (topic.substr(0, end) != stream.topic) return false;
  rest = topic.substr(end);
  return true;
}

void RosRecording::Note(const RosTopic& topic, const RosMessage& message,
                        std::span<const std::uint8_t> data) {
  const std::string_view name = topic.name;
  const auto reader = [&] { return RosReader(data, topic.is_cdr); };
  if (!name.starts_with("/device_0/")) return NoteRos(topic, message, reader());
  facts_.format = "RealSense .bag";
  std::string_view rest;
  if (name == "/device_0/info") {
    NoteDevice(reader());
  } else if (name.ends_with("/option/Depth Units/value")) {
    depth_unit_m_ = reader().Get<float>();
  } else if (name.ends_with("/option/Stereo Baseline/value")) {
    facts_.stereo_baseline_m = 1e-3 * static_cast<double>(reader().Get<float>());
  } else if (Belongs(name, "/Depth_", depth_, rest)) {
    NoteStream(depth_, rest, message, reader());
  } else if (Belongs(name, "/Color_", color_, rest)) {
    NoteStream(color_, rest, message, reader());
  }
}

std::string Above(std::string_view topic) { return std::string(topic.substr(0, topic.rfind('/'))); }

/// What ROS records of a camera's driver: a camera_info beside each image topic.
void RosRecording::NoteRos(const RosTopic& topic, const RosMessage& message, RosReader reader) {
  if (topic.type == "sensor_msgs/CameraInfo") {
    if (ros_cameras_.size() < kMostCameras)
      ros_cameras_.insert_or_assign(Above(topic.name), ParseRosCamera(reader));
  } else if (topic.name.ends_with("/extrinsics/depth_to_color")) {
    Eigen::Matrix3d turn;  // By columns.
    Eigen::Vector3d t_m;
    for (int i = 0; i < 9; ++i) turn(i % 3, i / 3) = reader.Get<double>();
    for (int i = 0; i < 3; ++i) t_m(i) = reader.Get<double>();
    color_.from_reference = Eigen::Translation3d(t_m) * RotationOf(turn);
    depth_.from_reference = Eigen::Isometry3d::Identity();
  } else if (topic.type == "tf2_msgs/TFMessage" && topic.name.ends_with("tf_static")) {
    frames_.Note(reader);
  } else if (topic.type == "sensor_msgs/Image" || topic.type == "sensor_msgs/CompressedImage") {
    NoteRosImage(topic, message, reader);
  }
}

/// The stream of the topic; nothing once there are too many to be those of cameras.
RosStream* RosRecording::CandidateOf(const RosTopic& topic, const RosImage& image, bool is_depth) {
  const auto found = std::ranges::find_if(candidates_, [&](const RosStream& stream) {
    return stream.topic == topic.name && stream.is_depth == is_depth;
  });
  if (found != candidates_.end()) return &*found;
  if (candidates_.size() >= kMostCameras) return nullptr;
  RosStream& stream = candidates_.emplace_back();
  stream.topic = topic.name;
  stream.is_cdr = topic.is_cdr;
  stream.is_packed = image.is_packed;
  stream.frame = image.frame;
  stream.is_depth = is_depth;
  stream.is_named_grey = IsNamedGrey(image);
  return &stream;
}

void RosRecording::NoteRosImage(const RosTopic& topic, const RosMessage& message,
                                RosReader reader) {
  if (IsInfrared(topic.name)) return;
  const RosImage image = ParseRosImage(reader, topic.type == "sensor_msgs/CompressedImage");
  const std::optional<RosImageKind> kind = KindOf(image);
  if (!kind) return;
  const bool is_depth = *kind != RosImageKind::kColor;
  RosStream* stream = CandidateOf(topic, image, is_depth);
  if (stream == nullptr) return;
  if (++num_candidates_images_ > kMostRecordedImages)
    throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
  // Some drivers leave the stamp 0.
  const double stamp_s = image.stamp_s > 0 ? image.stamp_s : message.time_s;
  stream->images.push_back({.message = message, .header_s = stamp_s});
  // By ROS's convention (REP 118) 16 bits are millimetres.
  if (is_depth)
    stream->unit_m = *kind == RosImageKind::kDepthInMetres ? 1.0 / kUnitsPerMetre : 1e-3;
}

/// The topics of depth and of colour that are used: no brightness in place of depth; depth that the
/// driver has aligned, because nothing of its camera need be known then; colour of its own camera.
/// Among equals, the first in the file.
void RosRecording::ChooseStreams() {
  const auto choose = [&](bool is_depth, const auto& rank) {
    RosStream* best = nullptr;
    for (RosStream& stream : candidates_)
      if (stream.is_depth == is_depth && (best == nullptr || rank(stream) > rank(*best)))
        best = &stream;
    return best;
  };
  RosStream* depth = choose(true, [](const RosStream& stream) {
    return (stream.is_named_grey ? 0 : 2) + (IsAligned(stream.topic) ? 1 : 0);
  });
  RosStream* color =
      choose(false, [](const RosStream& stream) { return IsColorInDepth(stream.topic) ? 0 : 1; });
  if (depth != nullptr && depth_.images.empty()) {
    depth_unit_m_ = depth->unit_m;
    depth->from_reference = depth_.from_reference;
    depth_ = std::move(*depth);
  }
  if (color != nullptr && color_.images.empty()) {
    color->from_reference = color_.from_reference;
    color_ = std::move(*color);
  }
  candidates_.clear();
}

/// The cameras of the topics that were chosen, and where these are.
void RosRecording::TakeRosCameras() {
  // A packed topic has one more part: /camera/color/image_raw/compressed.
  const auto image_topic = [](const RosStream& stream) {
    return stream.is_packed ? Above(stream.topic) : stream.topic;
  };
  const bool color_is_rectified = IsRectified(image_topic(color_));
  const bool depth_is_rectified = IsRectified(image_topic(depth_));
  bool has_lens = false;
  for (RosStream* stream : {&depth_, &color_}) {
    const std::string image = image_topic(*stream);
    const auto found = ros_cameras_.find(Above(image));
    if (found == ros_cameras_.end()) continue;
    stream->camera = found->second;
    const bool is_color = stream == &color_;
    if (is_color)
      has_lens = std::ranges::any_of(stream->camera->distortion, [](double d) { return d != 0; });
    if (IsRectified(image))
      stream->camera = Rectified(*std::move(stream->camera),
                                 is_color ? say::recording::Colour() : say::recording::Depth());
  }
  // Depth that was put onto colour's pixels is registered to these only: neither to those that were
  // rectified (or not) nor to colour in the depth camera's view.
  is_aligned_ = IsAligned(depth_.topic) && !IsColorInDepth(color_.topic) &&
                (color_is_rectified == depth_is_rectified || !has_lens);
  if (IsAligned(depth_.topic)) depth_.from_reference.reset();  // It was of depth's own camera.
  if (IsAligned(depth_.topic) != IsColorInDepth(color_.topic))
    color_.from_reference = depth_.from_reference = Eigen::Isometry3d::Identity();  // One view.
  if (depth_.from_reference || depth_.frame.empty() || color_.frame.empty()) return;
  color_.from_reference = frames_.Between(depth_.frame, color_.frame);
  if (color_.from_reference) depth_.from_reference = Eigen::Isometry3d::Identity();
}

void RosRecording::NoteDevice(RosReader reader) {
  const std::string_view key = reader.Text();
  const std::string value = Printable(reader.Text());
  if (key == "Name") facts_.name = value;
  if (key == "Serial Number") facts_.serial = value;
  if (key == "Firmware Version") facts_.firmware = value;
}

void RosRecording::NoteStream(RosStream& stream, std::string_view rest, const RosMessage& message,
                              RosReader reader) {
  if (rest == "/info/camera_info") {
    stream.camera = ParseRosCamera(reader);
  } else if (rest == "/tf/0") {
    std::array<double, 7> v{};
    for (double& value : v) value = reader.Get<double>();
    stream.from_reference = StaticFrames::PoseOf(v);
  } else if (rest == "/image/data") {
    if (stream.images.size() >= kMostRecordedImages)
      throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
    stream.images.push_back({.message = message, .header_s = reader.TakeHeader().stamp_s});
  } else if (rest == "/image/metadata" && !stream.images.empty() &&
             stream.images.back().message.time_s == message.time_s) {
    const std::string_view key = reader.Text();
    const std::optional<double> value = ParseNumber<double>(reader.Text());
    if (!value || !(*value >= 0 && *value < 1e15)) return;
    Listed& image = stream.images.back();
    if (key == "Sensor Timestamp") image.sensor_us = value;
    if (key == "Frame Timestamp") image.frame_us = value;
    if (key == "Actual Exposure") image.exposure_us = value;
  }
}

void RosRecording::CheckStreams() const {
  const auto check = [](const RosStream& stream, const Message& what) {
    if (stream.images.empty()) throw DataError(say::foreign::StreamMissing(what));
    if (!stream.camera) throw DataError(say::foreign::IntrinsicsMissing(what));
  };
  check(depth_, say::recording::Depth());
  check(color_, say::recording::Colour());
}

void RosRecording::StateCamera() {
  facts_.camera["image_width"] = color_.camera->width;
  facts_.camera["image_height"] = color_.camera->height;
  facts_.camera["camera_matrix"] = color_.camera->matrix;
  facts_.camera["distortion_coefficients"] = LensOf(*color_.camera, say::recording::Colour());
  if (depth_unit_m_ && *depth_unit_m_ > 0) {
    facts_.camera["depth_scale"] = 1.0 / *depth_unit_m_;
  } else {
    facts_.warnings.push_back(say::foreign::UnitMissing());
  }
  GuessClass();
  StateDepthCamera();
}

/// The class by the device's name; else, as ROS's drivers do not record one, by what they call
/// topics and frames.
void RosRecording::GuessClass() {
  std::optional<DepthSensor> sensor = ClassOfDevice(facts_.name);
  for (const std::string& name :
       {depth_.topic, color_.topic, depth_.frame, color_.frame, facts_.format}) {
    if (sensor) break;
    sensor = ClassOfRosName(name);
    if (sensor) facts_.class_by = Printable(name);
  }
  if (sensor) facts_.camera["depth_sensor"] = Name(*sensor);
}

void RosRecording::StateDepthCamera() {
  if (is_aligned_) {
    facts_.camera["depth_registered"] = 1;
    return;
  }
  facts_.camera["depth_registered"] = 0;
  facts_.camera["depth_image_width"] = depth_.camera->width;
  facts_.camera["depth_image_height"] = depth_.camera->height;
  facts_.camera["depth_camera_matrix"] = depth_.camera->matrix;
  facts_.camera["depth_distortion_coefficients"] = LensOf(*depth_.camera, say::recording::Depth());
  if (!depth_.from_reference || !color_.from_reference) {
    facts_.warnings.push_back(say::foreign::ExtrinsicsMissing());
    return;
  }
  const Eigen::Matrix4d T_color_depth =
      (*color_.from_reference * depth_.from_reference->inverse()).matrix();
  std::vector<double> rows;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) rows.push_back(T_color_depth(r, c));
  facts_.camera["T_color_depth"] = rows;
}

void RosRecording::SetStamps() {
  const auto has_mid = [](const RosStream& stream) {
    return std::ranges::all_of(stream.images,
                               [](const Listed& i) { return i.mid_us().has_value(); });
  };
  const bool mid = has_mid(color_) && has_mid(depth_);
  if (!mid) facts_.warnings.push_back(say::foreign::StampsNotMid());
  // Images that repeat a stamp are left out, so that the stamps rise.
  const auto set = [mid](RosStream& stream, std::vector<double>& stamps_s) {
    // Messages of ROS 2 may be recorded in another order than they were stamped.
    if (!mid) std::ranges::stable_sort(stream.images, {}, &Listed::header_s);
    Unwrapped unwrapped;
    std::vector<Listed> kept;
    for (const Listed& image : stream.images) {
      const double time_s = mid ? kMicro * unwrapped(*image.mid_us()) : image.header_s;
      if (!stamps_s.empty() && !(time_s > stamps_s.back())) continue;
      stamps_s.push_back(time_s);
      kept.push_back(image);
    }
    const std::size_t out = stream.images.size() - kept.size();
    stream.images = std::move(kept);
    return out;
  };
  const std::size_t left_out = set(color_, facts_.color_s) + set(depth_, facts_.depth_s);
  if (left_out > 0)
    facts_.warnings.push_back(say::foreign::StampsRepeat(static_cast<std::int64_t>(left_out)));
}

}  // namespace

std::unique_ptr<RecordedFile> OpenRosRecording(std::unique_ptr<RosMessages> messages) {
  return std::make_unique<RosRecording>(std::move(messages));
}

}  // namespace plumb
