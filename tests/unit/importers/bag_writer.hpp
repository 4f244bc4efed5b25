// SPDX-License-Identifier: Apache-2.0
// Writes ROS 1 bags as librealsense does, by the published formats and none of the reader's code.
#pragma once

#include <lz4frame.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace plumb::testing {

/// Bytes of numbers and counted texts, little-endian.
class Packed {
 public:
  template <typename Number>
  Packed& Add(Number number) {
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof number);
    return *this;
  }
  Packed& Counted(const std::string& text) {
    Add(static_cast<std::uint32_t>(text.size()));
    bytes_ += text;
    return *this;
  }
  Packed& Raw(const std::string& bytes) {
    bytes_ += bytes;
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

struct BagStreamTruth {
  std::string topic;  ///< Such as "/device_0/sensor_0/Depth_0".
  std::uint32_t width = 0, height = 0;
  std::string encoding;
  double f = 0, cx = 0, cy = 0;
  std::string model = "Brown Conrady";
  std::vector<double> distortion = {0, 0, 0, 0, 0};
};

class BagWriter {
 public:
  enum class Packing { kNone, kLz4, kBz2 };
  explicit BagWriter(Packing packing) : packing_(packing) {}

  void Message(const std::string& topic, const std::string& type, const std::string& data,
               double time_s = 0.0) {
    const auto [known, is_new] =
        connections_.try_emplace(topic, static_cast<std::uint32_t>(connections_.size()));
    const std::string conn = "conn=" + Raw(known->second);
    if (is_new)
      chunk_ += Record(
          {"op=\x07", conn, "topic=" + topic},
          Fields({"topic=" + topic, "type=" + type, "md5sum=0", "message_definition=any text"}));
    const auto seconds = static_cast<std::uint32_t>(time_s);
    const auto nanoseconds = static_cast<std::uint32_t>((time_s - seconds) * 1e9);
    chunk_ += Record({"op=\x02", conn, "time=" + Raw(seconds) + Raw(nanoseconds)}, data);
  }
  void KeyValue(const std::string& topic, const std::string& key, const std::string& value,
                double time_s = 0.0) {
    Message(topic, "diagnostic_msgs/KeyValue", Packed().Counted(key).Counted(value).bytes(),
            time_s);
  }
  void Camera(const BagStreamTruth& stream) { CameraInfo(stream, "/info/camera_info"); }
  void RosCamera(const BagStreamTruth& stream) { CameraInfo(stream, "/camera_info"); }
  void RosImage(const BagStreamTruth& stream, const std::string& pixels, double header_s) {
    Image(stream, pixels, header_s, header_s, "/image_raw");
  }
  void CameraInfo(const BagStreamTruth& stream, const std::string& topic) {
    Packed info;
    info.Add(std::uint32_t{0}).Add(std::uint64_t{0}).Counted("");
    info.Add(stream.height).Add(stream.width).Counted(stream.model);
    info.Add(static_cast<std::uint32_t>(stream.distortion.size()));
    for (const double d : stream.distortion) info.Add(d);
    for (const double k : {stream.f, 0.0, stream.cx, 0.0, stream.f, stream.cy, 0.0, 0.0, 1.0})
      info.Add(k);
    for (int i = 0; i < 9 + 12; ++i) info.Add(0.0);
    for (int i = 0; i < 6; ++i) info.Add(std::uint32_t{0});
    info.Add(std::uint8_t{0});
    Message(stream.topic + topic, "sensor_msgs/CameraInfo", info.bytes());
  }
  /// @param turn  Quaternion x y z w.
  void Pose(const BagStreamTruth& stream, const std::array<double, 3>& t_m,
            const std::array<double, 4>& turn = {0, 0, 0, 1}) {
    Packed pose;
    for (const double v : t_m) pose.Add(v);
    for (const double v : turn) pose.Add(v);
    Message(stream.topic + "/tf/0", "geometry_msgs/Transform", pose.bytes());
  }
  void Image(const BagStreamTruth& stream, const std::string& pixels, double header_s,
             double time_s, const std::string& topic = "/image/data") {
    Packed image;
    const auto seconds = static_cast<std::uint32_t>(header_s);
    image.Add(std::uint32_t{1}).Add(seconds);
    image.Add(static_cast<std::uint32_t>((header_s - seconds) * 1e9 + 0.5)).Counted("0");
    image.Add(stream.height).Add(stream.width).Counted(stream.encoding).Add(std::uint8_t{0});
    image.Add(static_cast<std::uint32_t>(pixels.size() / stream.height)).Counted(pixels);
    Message(stream.topic + topic, "sensor_msgs/Image", image.bytes(), time_s);
  }
  /// Ends a chunk; so does Finish().
  void EndChunk() {
    if (chunk_.empty()) return;
    const char* const name = packing_ == Packing::kNone  ? "none"
                             : packing_ == Packing::kLz4 ? "lz4"
                                                         : "bz2";
    body_ += Record({"op=\x05", std::string("compression=") + name,
                     "size=" + Raw(static_cast<std::uint32_t>(chunk_.size()))},
                    packing_ == Packing::kLz4 ? Lz4(chunk_) : chunk_);
    body_ += Record({"op=\x04", "ver=" + Raw(std::uint32_t{1}), "conn=" + Raw(std::uint32_t{0}),
                     "count=" + Raw(std::uint32_t{0})},
                    "");
    chunk_.clear();
  }
  [[nodiscard]] std::vector<std::uint8_t> Finish() {
    EndChunk();
    const std::string file =
        "#ROSBAG V2.0\n" +
        Record({"op=\x03", "conn_count=" + Raw(std::uint32_t{0}),
                "chunk_count=" + Raw(std::uint32_t{0}), "index_pos=" + Raw(std::uint64_t{0})},
               std::string(64, ' ')) +
        body_;
    return {file.begin(), file.end()};
  }

 private:
  template <typename Number>
  static std::string Raw(Number number) {
    return Packed().Add(number).bytes();
  }
  static std::string Fields(const std::vector<std::string>& fields) {
    Packed packed;
    for (const std::string& field : fields) packed.Counted(field);
    return packed.bytes();
  }
  static std::string Record(const std::vector<std::string>& fields, const std::string& data) {
    return Packed().Counted(Fields(fields)).Counted(data).bytes();
  }
  static std::string Lz4(const std::string& bytes) {
    std::string packed(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
    packed.resize(
        LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
    return packed;
  }

  const Packing packing_;
  std::map<std::string, std::uint32_t> connections_;
  std::string chunk_, body_;
};

}  // namespace plumb::testing
