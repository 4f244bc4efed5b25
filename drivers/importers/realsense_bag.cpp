// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/realsense_bag.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/byte_reader.hpp"
#include "drivers/importers/ros_bag.hpp"
#include "drivers/replay/device_class.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMaxFact = 64;
constexpr double kMicro = 1e-6;
constexpr std::size_t kMostCameras = 64;

/// Text of a file for facts: short and printable.
std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, kMaxFact));
  std::ranges::replace_if(
      printable, [](char c) { return c < ' ' || c >= 0x7f; }, '?');
  return printable;
}

struct CameraInfo {
  std::uint32_t width = 0, height = 0;
  std::string model;
  std::vector<double> distortion;
  std::array<double, 9> matrix{};
};

/// sensor_msgs/CameraInfo, as far as it is needed.
CameraInfo ParseCameraInfo(ByteReader reader) {
  CameraInfo info;
  (void)reader.Take(12);  // Number and stamp.
  (void)reader.Text();
  info.height = reader.Get<std::uint32_t>();
  info.width = reader.Get<std::uint32_t>();
  info.model = reader.Text();
  const auto count = reader.Get<std::uint32_t>();
  if (count > 16) throw DataError(say::foreign::LensCount(count));
  for (std::uint32_t i = 0; i < count; ++i) info.distortion.push_back(reader.Get<double>());
  for (double& element : info.matrix) element = reader.Get<double>();
  return info;
}

/// sensor_msgs/Image.
struct ImageMessage {
  double stamp_s = 0.0;
  std::uint32_t width = 0, height = 0;
  std::string_view encoding;
  std::uint32_t step = 0;
  std::span<const std::uint8_t> data;
};

ImageMessage ParseImage(ByteReader reader) {
  ImageMessage image;
  (void)reader.Get<std::uint32_t>();
  image.stamp_s = reader.Get<std::uint32_t>();
  image.stamp_s += 1e-9 * reader.Get<std::uint32_t>();
  (void)reader.Text();
  image.height = reader.Get<std::uint32_t>();
  image.width = reader.Get<std::uint32_t>();
  image.encoding = reader.Text();
  if (reader.Get<std::uint8_t>() != 0) throw DataError(say::foreign::BigEndian());
  image.step = reader.Get<std::uint32_t>();
  image.data = reader.Counted();
  return image;
}

/// What each encoding holds, and how OpenCV makes RGB of it.
struct Encoding {
  std::string_view name;
  int type = CV_8UC3;
  int to_rgb = -1;  ///< -1: as it is.
};
constexpr std::array<Encoding, 7> kColorEncodings = {{
    {"rgb8", CV_8UC3, -1},
    {"bgr8", CV_8UC3, cv::COLOR_BGR2RGB},
    {"rgba8", CV_8UC4, cv::COLOR_RGBA2RGB},
    {"bgra8", CV_8UC4, cv::COLOR_BGRA2RGB},
    {"yuyv", CV_8UC2, cv::COLOR_YUV2RGB_YUY2},
    {"YUYV", CV_8UC2, cv::COLOR_YUV2RGB_YUY2},
    {"yuv422", CV_8UC2, cv::COLOR_YUV2RGB_UYVY},
}};
constexpr std::array<Encoding, 2> kDepthEncodings = {{{"mono16", CV_16UC1}, {"16UC1", CV_16UC1}}};

/// The image in a message, which must fit its size to the byte.
template <std::size_t N>
cv::Mat Pixels(const ImageMessage& image, const std::array<Encoding, N>& known) {
  const auto encoding = std::ranges::find(known, image.encoding, &Encoding::name);
  if (encoding == known.end()) {
    std::vector<std::string> names;
    for (const Encoding& one : known) names.emplace_back(one.name);
    throw DataError(say::foreign::Encoding(Printable(image.encoding), names));
  }
  const std::uint64_t row = std::uint64_t{image.width} * CV_ELEM_SIZE(encoding->type);
  if (image.width < 1 || image.width > kMaxImageSide || image.height < 1 ||
      image.height > kMaxImageSide || image.step < row ||
      std::uint64_t{image.step} * image.height != image.data.size())
    throw DataError(say::foreign::ImageSize(image.width, image.height,
                                            static_cast<std::int64_t>(image.data.size())));
  cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width), encoding->type);
  for (int y = 0; y < pixels.rows; ++y)
    std::copy_n(image.data.data() + std::size_t{image.step} * static_cast<std::size_t>(y), row,
                pixels.ptr(y));
  if (encoding->to_rgb < 0) return pixels;
  if (pixels.channels() == 2 && pixels.cols % 2 != 0)
    throw DataError(say::foreign::ImageSize(image.width, image.height,
                                            static_cast<std::int64_t>(image.data.size())));
  cv::Mat rgb;
  cv::cvtColor(pixels, rgb, encoding->to_rgb);
  return rgb;
}

/// One image, where its pixels are, and what is known of its time.
struct Listed {
  BagMessage message;
  double header_s = 0.0;
  std::optional<double> sensor_us = {};  ///< Mid-exposure, by the sensor's clock.
  std::optional<double> frame_us = {}, exposure_us = {};
  [[nodiscard]] std::optional<double> mid_us() const {
    if (sensor_us) return sensor_us;
    if (frame_us && exposure_us) return *frame_us - 0.5 * *exposure_us;
    return std::nullopt;
  }
};

struct BagStream {
  std::string topic;  ///< Such as /device_0/sensor_0/Depth_0; empty: not there.
  std::optional<CameraInfo> camera;
  std::optional<Eigen::Isometry3d> from_reference;
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

class RealSenseBag : public RecordedFile {
 public:
  explicit RealSenseBag(FileBytes bytes) : bag_(std::move(bytes)) {
    facts_.format = "RealSense .bag";
    bag_.ForEach([this](const BagConnection& connection, const BagMessage& message,
                        std::span<const std::uint8_t> data) { Note(connection, message, data); });
    TakeRosCameras();
    CheckStreams();
    StateCamera();
    SetStamps();
  }
  [[nodiscard]] const RecordedFacts& facts() const override { return facts_; }
  [[nodiscard]] cv::Mat Color(std::size_t i) override {
    return Pixels(ParseImage(ByteReader(bag_.Read(color_.images.at(i).message))), kColorEncodings);
  }
  [[nodiscard]] cv::Mat Depth(std::size_t i) override {
    return Pixels(ParseImage(ByteReader(bag_.Read(depth_.images.at(i).message))), kDepthEncodings);
  }

 private:
  void Note(const BagConnection& connection, const BagMessage& message,
            std::span<const std::uint8_t> data);
  void NoteStream(BagStream& stream, std::string_view rest, const BagMessage& message,
                  ByteReader reader);
  void NoteDevice(ByteReader reader);
  void NoteRos(const BagConnection& connection, const BagMessage& message, ByteReader reader);
  void TakeRosCameras();
  void CheckStreams() const;
  void StateCamera();
  void StateDepthCamera();
  void SetStamps();

  RosBag bag_;
  RecordedFacts facts_;
  BagStream color_, depth_;
  std::optional<double> depth_unit_m_;
  std::map<std::string, CameraInfo, std::less<>> ros_cameras_;  ///< By the parent of their topic.
  bool is_aligned_ = false;  ///< Depth is registered to colour: a ROS driver did that.
};

/// Whether the topic belongs to the first stream of this kind; `rest` is then what follows the
/// stream's own part of the topic.
bool Belongs(std::string_view topic, std::string_view kind, BagStream& stream,
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

void RealSenseBag::Note(const BagConnection& connection, const BagMessage& message,
                        std::span<const std::uint8_t> data) {
  const std::string_view topic = connection.topic;
  if (!topic.starts_with("/device_0/")) return NoteRos(connection, message, ByteReader(data));
  std::string_view rest;
  if (topic == "/device_0/info") {
    NoteDevice(ByteReader(data));
  } else if (topic.ends_with("/option/Depth Units/value")) {
    depth_unit_m_ = ByteReader(data).Get<float>();
  } else if (topic.ends_with("/option/Stereo Baseline/value")) {
    facts_.stereo_baseline_m = 1e-3 * static_cast<double>(ByteReader(data).Get<float>());
  } else if (Belongs(topic, "/Depth_", depth_, rest)) {
    NoteStream(depth_, rest, message, ByteReader(data));
  } else if (Belongs(topic, "/Color_", color_, rest)) {
    NoteStream(color_, rest, message, ByteReader(data));
  }
}

std::string Above(std::string_view topic) { return std::string(topic.substr(0, topic.rfind('/'))); }

/// What `rosbag record` keeps of a camera's ROS driver: a camera_info beside each image topic.
void RealSenseBag::NoteRos(const BagConnection& connection, const BagMessage& message,
                           ByteReader reader) {
  if (connection.type == "sensor_msgs/CameraInfo") {
    if (ros_cameras_.size() < kMostCameras)
      ros_cameras_.insert_or_assign(Above(connection.topic), ParseCameraInfo(reader));
  } else if (connection.topic.ends_with("/extrinsics/depth_to_color")) {
    Eigen::Matrix3d turn;  // By columns.
    Eigen::Vector3d t_m;
    for (int i = 0; i < 9; ++i) turn(i % 3, i / 3) = reader.Get<double>();
    for (int i = 0; i < 3; ++i) t_m(i) = reader.Get<double>();
    color_.from_reference = Eigen::Translation3d(t_m) * Eigen::Quaterniond(turn).normalized();
    depth_.from_reference = Eigen::Isometry3d::Identity();
  } else if (connection.type == "sensor_msgs/Image") {
    const ImageMessage image = ParseImage(reader);
    const auto is_of = [&](const auto& encodings) {
      return std::ranges::find(encodings, image.encoding, &Encoding::name) != encodings.end();
    };
    if (!is_of(kDepthEncodings) && !is_of(kColorEncodings)) return;
    BagStream& stream = is_of(kDepthEncodings) ? depth_ : color_;
    // Depth that the driver has aligned is preferred: nothing of its camera need be known.
    const bool aligned = connection.topic.find("/aligned_depth_to_color/") != std::string::npos;
    if (stream.topic.empty() || (aligned && !is_aligned_ && is_of(kDepthEncodings))) {
      stream.topic = connection.topic;
      stream.images.clear();
      is_aligned_ = is_aligned_ || (aligned && is_of(kDepthEncodings));
    }
    if (stream.topic != connection.topic) return;
    if (stream.images.size() >= kMostRecordedImages)
      throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
    stream.images.push_back({.message = message, .header_s = image.stamp_s});
    facts_.format = "ROS bag";
    depth_unit_m_ = 1e-3;  // By ROS's convention for 16 bits (REP 118).
  }
}

/// The cameras of the topics that were chosen.
void RealSenseBag::TakeRosCameras() {
  for (BagStream* stream : {&depth_, &color_})
    if (const auto found = ros_cameras_.find(Above(stream->topic)); found != ros_cameras_.end())
      stream->camera = found->second;
}

void RealSenseBag::NoteDevice(ByteReader reader) {
  const std::string_view key = reader.Text();
  const std::string value = Printable(reader.Text());
  if (key == "Name") facts_.name = value;
  if (key == "Serial Number") facts_.serial = value;
  if (key == "Firmware Version") facts_.firmware = value;
}

void RealSenseBag::NoteStream(BagStream& stream, std::string_view rest, const BagMessage& message,
                              ByteReader reader) {
  if (rest == "/info/camera_info") {
    stream.camera = ParseCameraInfo(reader);
  } else if (rest == "/tf/0") {
    std::array<double, 7> v{};
    for (double& value : v) value = reader.Get<double>();
    const Eigen::Quaterniond turn(v[6], v[3], v[4], v[5]);
    if (!(std::abs(turn.norm() - 1.0) < 1e-3)) throw DataError(say::foreign::Rotation());
    stream.from_reference = Eigen::Translation3d(v[0], v[1], v[2]) * turn.normalized();
  } else if (rest == "/image/data") {
    if (stream.images.size() >= kMostRecordedImages)
      throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
    stream.images.push_back({.message = message, .header_s = ParseImage(reader).stamp_s});
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

void RealSenseBag::CheckStreams() const {
  const auto check = [](const BagStream& stream, const Message& what) {
    if (stream.images.empty()) throw DataError(say::foreign::StreamMissing(what));
    if (!stream.camera) throw DataError(say::foreign::IntrinsicsMissing(what));
  };
  check(depth_, say::recording::Depth());
  check(color_, say::recording::Colour());
}

/// The lens as camera.yaml has it. librealsense projects with its "inverse" and "modified" models
/// as OpenCV does, but for the order of the last two terms.
std::vector<double> Lens(const CameraInfo& camera, const Message& what) {
  constexpr std::array kPlain = {
      "Brown Conrady", "Modified Brown Conrady", "Inverse Brown Conrady", "None",
      "plumb_bob",     "rational_polynomial"};
  const bool is_zero = std::ranges::all_of(camera.distortion, [](double d) { return d == 0; });
  if (!is_zero && std::ranges::find(kPlain, camera.model) == kPlain.end())
    throw DataError(say::foreign::LensModel(what, Printable(camera.model)));
  std::vector<double> lens = camera.distortion;
  lens.resize(std::max<std::size_t>(5, lens.size()));  // Longer ones are checked later.
  return lens;
}

void RealSenseBag::StateCamera() {
  facts_.camera["image_width"] = color_.camera->width;
  facts_.camera["image_height"] = color_.camera->height;
  facts_.camera["camera_matrix"] = color_.camera->matrix;
  facts_.camera["distortion_coefficients"] = Lens(*color_.camera, say::recording::Colour());
  if (depth_unit_m_ && *depth_unit_m_ > 0) {
    facts_.camera["depth_scale"] = 1.0 / *depth_unit_m_;
  } else {
    facts_.warnings.push_back(say::foreign::UnitMissing());
  }
  if (const auto sensor = ClassOfDevice(facts_.name)) facts_.camera["depth_sensor"] = Name(*sensor);
  StateDepthCamera();
}

void RealSenseBag::StateDepthCamera() {
  if (is_aligned_) {
    facts_.camera["depth_registered"] = 1;
    return;
  }
  facts_.camera["depth_registered"] = 0;
  facts_.camera["depth_image_width"] = depth_.camera->width;
  facts_.camera["depth_image_height"] = depth_.camera->height;
  facts_.camera["depth_camera_matrix"] = depth_.camera->matrix;
  facts_.camera["depth_distortion_coefficients"] = Lens(*depth_.camera, say::recording::Depth());
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

void RealSenseBag::SetStamps() {
  const auto has_mid = [](const BagStream& stream) {
    return std::ranges::all_of(stream.images,
                               [](const Listed& i) { return i.mid_us().has_value(); });
  };
  const bool mid = has_mid(color_) && has_mid(depth_);
  if (!mid) facts_.warnings.push_back(say::foreign::StampsNotMid());
  // Images that repeat a stamp are left out, so that the stamps rise.
  const auto set = [mid](BagStream& stream, std::vector<double>& stamps_s) {
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

std::unique_ptr<RecordedFile> OpenRealSenseBag(FileBytes bytes) {
  return std::make_unique<RealSenseBag>(std::move(bytes));
}

}  // namespace plumb
