// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/sens_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/byte_reader.hpp"
#include "drivers/replay/device_class.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxName = 1000;
constexpr std::size_t kHeaderBytes = 4 * 16 * 4 + 2 * 4 + 4 * 4 + 4 + 8;  // Behind the name.
constexpr std::size_t kFrameBytes = 16 * 4 + 4 * 8;
constexpr std::uint64_t kMaxImage = std::uint64_t{256} << 20U;
constexpr double kAssumedRate_hz = 30.0;
constexpr std::int32_t kRaw = 0, kPng = 1, kJpeg = 2, kZlib = 1;

using Matrix = std::array<float, 16>;
constexpr Matrix kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

Matrix MatrixIn(ByteReader& reader) {
  Matrix matrix{};
  for (float& element : matrix) element = reader.Get<float>();
  return matrix;
}

/// The 3x3 part, as camera.yaml has it.
std::array<double, 9> CameraMatrix(const Matrix& k) {
  return {k[0], k[1], k[2], k[4], k[5], k[6], k[8], k[9], k[10]};
}

class SensFile : public RecordedFile {
 public:
  explicit SensFile(FileBytes bytes) : bytes_(std::move(bytes)) {
    facts_.format = "ScanNet .sens";
    ReadFrames(ReadHeader());
  }
  [[nodiscard]] const RecordedFacts& facts() const override { return facts_; }
  [[nodiscard]] cv::Mat Color(std::size_t i) override {
    const Place& place = frames_.at(i);
    const std::vector<std::uint8_t> packed = BytesAt(place.color, place.color_size);
    if (color_packing_ != kRaw) return DecodeColorImage(packed, "colour");
    return Pixels(packed, color_width_, color_height_, CV_8UC3);
  }
  [[nodiscard]] cv::Mat Depth(std::size_t i) override {
    const Place& place = frames_.at(i);
    const std::vector<std::uint8_t> packed =
        BytesAt(place.color + place.color_size, place.depth_size);
    if (depth_packing_ == kRaw) return Pixels(packed, depth_width_, depth_height_, CV_16UC1);
    std::vector<std::uint8_t> unpacked(std::size_t{depth_width_} * depth_height_ * 2);
    auto size = static_cast<uLongf>(unpacked.size());
    if (::uncompress(unpacked.data(), &size, packed.data(), packed.size()) != Z_OK)
      throw DataError(say::foreign::SensPacking());
    unpacked.resize(size);
    return Pixels(unpacked, depth_width_, depth_height_, CV_16UC1);
  }

 private:
  struct Place {
    std::uint64_t color = 0;  ///< The depth is right behind it.
    std::size_t color_size = 0, depth_size = 0;
  };
  [[nodiscard]] std::vector<std::uint8_t> BytesAt(std::uint64_t offset, std::size_t count) const {
    if (offset > bytes_.size || count > bytes_.size - offset)
      throw DataError(say::foreign::EndsEarly(
          static_cast<std::int64_t>(count),
          static_cast<std::int64_t>(bytes_.size - std::min(offset, bytes_.size))));
    std::vector<std::uint8_t> bytes(count);
    if (!bytes_.read(offset, bytes)) throw DataError(say::foreign::Unreadable());
    return bytes;
  }
  static cv::Mat Pixels(const std::vector<std::uint8_t>& bytes, std::uint32_t width,
                        std::uint32_t height, int type) {
    cv::Mat image(static_cast<int>(height), static_cast<int>(width), type);
    if (bytes.size() != image.total() * image.elemSize())
      throw DataError(
          say::foreign::ImageSize(width, height, static_cast<std::int64_t>(bytes.size())));
    std::memcpy(image.data, bytes.data(), bytes.size());
    return image;
  }
  /// @return the place of the first frame.
  std::uint64_t ReadHeader();
  void ReadFrames(std::uint64_t place);

  FileBytes bytes_;
  RecordedFacts facts_;
  std::int32_t color_packing_ = 0, depth_packing_ = 0;
  std::uint32_t color_width_ = 0, color_height_ = 0, depth_width_ = 0, depth_height_ = 0;
  std::uint64_t num_frames_ = 0;
  std::vector<Place> frames_;
};

std::uint64_t SensFile::ReadHeader() {
  const std::vector<std::uint8_t> first = BytesAt(0, 12);
  ByteReader start(first);
  const auto version = start.Get<std::uint32_t>();
  const auto length = start.Get<std::uint64_t>();
  if (version != 4 || length > kMaxName) throw DataError(say::foreign::UnknownFormat());
  const std::vector<std::uint8_t> bytes = BytesAt(12, length + kHeaderBytes);
  ByteReader reader(bytes);
  for (const std::uint8_t c : reader.Take(length))
    if (facts_.name.size() < 64) facts_.name += c >= ' ' && c < 0x7f ? static_cast<char>(c) : '?';
  const Matrix color = MatrixIn(reader), color_pose = MatrixIn(reader);
  const Matrix depth = MatrixIn(reader), depth_pose = MatrixIn(reader);
  color_packing_ = reader.Get<std::int32_t>();
  depth_packing_ = reader.Get<std::int32_t>();
  for (std::uint32_t* side : {&color_width_, &color_height_, &depth_width_, &depth_height_}) {
    *side = reader.Get<std::uint32_t>();
    if (*side < 1 || *side > kMaxImageSide)
      throw DataError(say::foreign::ImageSize(color_width_, color_height_, 0));
  }
  const auto units_per_metre = reader.Get<float>();
  num_frames_ = reader.Get<std::uint64_t>();
  if (num_frames_ > kMostRecordedImages)
    throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
  const bool known =
      (color_packing_ == kRaw || color_packing_ == kPng || color_packing_ == kJpeg) &&
      (depth_packing_ == kRaw || depth_packing_ == kZlib);
  if (!known) throw DataError(say::foreign::SensPacking());
  facts_.camera = {{"image_width", color_width_},
                   {"image_height", color_height_},
                   {"camera_matrix", CameraMatrix(color)},
                   {"distortion_coefficients", {0, 0, 0, 0, 0}},
                   {"depth_scale", units_per_metre},
                   {"depth_registered", 0},
                   {"depth_image_width", depth_width_},
                   {"depth_image_height", depth_height_},
                   {"depth_camera_matrix", CameraMatrix(depth)},
                   {"depth_distortion_coefficients", {0, 0, 0, 0, 0}}};
  if (const auto sensor = ClassOfDevice(facts_.name)) facts_.camera["depth_sensor"] = Name(*sensor);
  if (color_pose == kIdentity && depth_pose == kIdentity)
    facts_.camera["T_color_depth"] = kIdentity;
  else
    facts_.warnings.push_back(say::foreign::ExtrinsicsMissing());
  return 12 + bytes.size();
}

void SensFile::ReadFrames(std::uint64_t place) {
  std::vector<double> color_s, depth_s;
  bool rise = true;
  for (std::uint64_t i = 0; i < num_frames_; ++i) {
    const std::vector<std::uint8_t> bytes = BytesAt(place, kFrameBytes);
    ByteReader reader(bytes);
    (void)MatrixIn(reader);
    const auto color_us = reader.Get<std::uint64_t>(), depth_us = reader.Get<std::uint64_t>();
    const auto color = reader.Get<std::uint64_t>(), depth = reader.Get<std::uint64_t>();
    place += kFrameBytes;
    if (color > kMaxImage || depth > kMaxImage || color + depth > bytes_.size - place)
      throw DataError(say::foreign::EndsEarly(
          static_cast<std::int64_t>(std::min(color, kMaxImage) + std::min(depth, kMaxImage)),
          static_cast<std::int64_t>(bytes_.size - place)));
    frames_.push_back({place, static_cast<std::size_t>(color), static_cast<std::size_t>(depth)});
    place += color + depth;
    const double color_time_s = 1e-6 * static_cast<double>(color_us);
    const double depth_time_s = 1e-6 * static_cast<double>(depth_us);
    rise = rise && color_time_s < 1e10 && depth_time_s < 1e10 &&
           (color_s.empty() || (color_time_s > color_s.back() && depth_time_s > depth_s.back()));
    color_s.push_back(color_time_s);
    depth_s.push_back(depth_time_s);
  }
  if (!rise) {  // Some writers leave them 0.
    facts_.warnings.push_back(say::foreign::RateAssumed(kAssumedRate_hz));
    for (std::size_t i = 0; i < color_s.size(); ++i)
      color_s[i] = depth_s[i] = static_cast<double>(i) / kAssumedRate_hz;
  }
  facts_.color_s = std::move(color_s);
  facts_.depth_s = std::move(depth_s);
}

}  // namespace

std::unique_ptr<RecordedFile> OpenSensFile(FileBytes bytes) {
  return std::make_unique<SensFile>(std::move(bytes));
}

}  // namespace plumb
