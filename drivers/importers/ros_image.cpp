// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/ros_image.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/image_file.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxFact = 64;

/// What each encoding holds, and how OpenCV makes RGB of it.
struct Encoding {
  std::string_view name;
  int type = CV_8UC3;
  int to_rgb = -1;  ///< -1: as it is.
};
constexpr std::array<Encoding, 9> kColorEncodings = {{
    {"rgb8", CV_8UC3, -1},
    {"bgr8", CV_8UC3, cv::COLOR_BGR2RGB},
    {"rgba8", CV_8UC4, cv::COLOR_RGBA2RGB},
    {"bgra8", CV_8UC4, cv::COLOR_BGRA2RGB},
    {"yuyv", CV_8UC2, cv::COLOR_YUV2RGB_YUY2},
    {"YUYV", CV_8UC2, cv::COLOR_YUV2RGB_YUY2},
    {"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2RGB_YUY2},
    {"yuv422", CV_8UC2, cv::COLOR_YUV2RGB_UYVY},
    {"uyvy", CV_8UC2, cv::COLOR_YUV2RGB_UYVY},
}};
constexpr std::array<Encoding, 3> kDepthEncodings = {
    {{"mono16", CV_16UC1}, {"16UC1", CV_16UC1}, {"32FC1", CV_32FC1}}};

[[noreturn]] void WrongSize(const RosImage& image) {
  throw DataError(say::foreign::ImageSize(image.width, image.height,
                                          static_cast<std::int64_t>(image.data.size())));
}

/// The image in a message, which must fit its size to the byte.
template <std::size_t N>
std::pair<cv::Mat, int> Pixels(const RosImage& image, const std::array<Encoding, N>& known) {
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
    WrongSize(image);
  cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width), encoding->type);
  for (int y = 0; y < pixels.rows; ++y)
    std::copy_n(image.data.data() + std::size_t{image.step} * static_cast<std::size_t>(y), row,
                pixels.ptr(y));
  return {pixels, encoding->to_rgb};
}

constexpr std::size_t kPackedHeader = 12;

/// The PNG of 16 bits of grey in a packed image; empty if there is none. The plug-in of
/// image_transport for depth writes 12 bytes before it.
std::span<const std::uint8_t> GreyPng(const RosImage& image) {
  constexpr std::array<std::uint8_t, 8> kPng = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  for (const std::size_t before : {std::size_t{0}, kPackedHeader}) {
    if (image.data.size() < before + 26) continue;
    const auto png = image.data.subspan(before);
    if (std::equal(kPng.begin(), kPng.end(), png.begin()) && png[24] == 16 && png[25] == 0)
      return png;
  }
  return {};
}

/// Whether the plug-in has packed floats: as v = a / z + b, of which a and b are in its header.
bool HasInverseDepth(const RosImage& image) {
  return image.is_packed && image.encoding.starts_with("32FC1");
}

/// A depth in metres, as stored.
std::uint16_t UnitsOf(float z_m) {
  return z_m > 0 && z_m < 65534.0 / kUnitsPerMetre
             ? static_cast<std::uint16_t>(z_m * kUnitsPerMetre + 0.5)
             : std::uint16_t{0};
}

cv::Mat UnpackInverse(const RosImage& image) {
  std::array<float, 2> terms{};
  std::memcpy(terms.data(), image.data.data() + kPackedHeader - sizeof terms, sizeof terms);
  const auto [a, b] = terms;
  cv::Mat units = DecodeDepthImage(GreyPng(image), "depth");
  for (int y = 0; y < units.rows; ++y)
    for (int x = 0; x < units.cols; ++x)
      if (auto& value = units.at<std::uint16_t>(y, x); value != 0)
        value = UnitsOf(a / (static_cast<float>(value) - b));
  return units;
}

}  // namespace

std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, kMaxFact));
  std::ranges::replace_if(
      printable, [](char c) { return c < ' ' || c >= 0x7f; }, '?');
  return printable;
}

RosCamera ParseRosCamera(RosReader reader) {
  RosCamera camera;
  (void)reader.TakeHeader();
  camera.height = reader.Get<std::uint32_t>();
  camera.width = reader.Get<std::uint32_t>();
  camera.model = reader.Text();
  const auto count = reader.Get<std::uint32_t>();
  if (count > 16) throw DataError(say::foreign::LensCount(count));
  for (std::uint32_t i = 0; i < count; ++i) camera.distortion.push_back(reader.Get<double>());
  for (auto* matrix : {&camera.matrix, &camera.rectification})
    for (double& element : *matrix) element = reader.Get<double>();
  for (std::size_t i = 0; i < 12; ++i)
    if (const auto element = reader.Get<double>(); i % 4 != 3)
      camera.rectified.at(3 * (i / 4) + i % 4) = element;
  return camera;
}

RosCamera Rectified(RosCamera camera, const Message& what) {
  if (std::ranges::all_of(camera.distortion, [](double d) { return d == 0; })) return camera;
  // Of a single camera the identity, of a calibrated pair another turn for each of the two.
  const auto is_near = [](double a, double b) { return std::abs(a - b) < 1e-6; };
  const std::array<double, 9> identity = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  if (!std::ranges::equal(camera.rectification, identity, is_near) || !(camera.rectified[0] > 0))
    throw DataError(say::foreign::Rectified(what));
  camera.matrix = camera.rectified;
  camera.distortion.clear();
  return camera;
}

std::vector<double> LensOf(const RosCamera& camera, const Message& what) {
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

RosImage ParseRosImage(RosReader reader, bool is_packed) {
  RosImage image;
  const RosReader::Header header = reader.TakeHeader();
  image.stamp_s = header.stamp_s;
  image.frame = header.frame;
  image.is_packed = is_packed;
  if (!is_packed) {
    image.height = reader.Get<std::uint32_t>();
    image.width = reader.Get<std::uint32_t>();
  }
  image.encoding = reader.Text();
  if (!is_packed) {
    if (reader.Get<std::uint8_t>() != 0) throw DataError(say::foreign::BigEndian());
    image.step = reader.Get<std::uint32_t>();
  }
  image.data = reader.Counted();
  return image;
}

bool IsNamedGrey(const RosImage& image) { return image.encoding.starts_with("mono"); }

std::optional<RosImageKind> KindOf(const RosImage& image) {
  const auto is_of = [&](const auto& encodings) {
    return std::ranges::find(encodings, image.encoding, &Encoding::name) != encodings.end();
  };
  if (image.is_packed) {
    if (const auto png = GreyPng(image); !png.empty()) {
      if (!HasInverseDepth(image)) return RosImageKind::kDepth;
      // Without the header nothing says what the values mean.
      return png.data() == image.data.data() ? std::nullopt
                                             : std::optional(RosImageKind::kDepthInMetres);
    }
    // Infrared images are packed, too; what cannot be unpacked says so later.
    const bool is_grey = image.encoding.starts_with("mono") || image.encoding.starts_with("8UC1") ||
                         image.encoding.starts_with("16UC1") || image.encoding.starts_with("32FC1");
    return is_grey ? std::nullopt : std::optional(RosImageKind::kColor);
  }
  if (image.encoding == "32FC1") return RosImageKind::kDepthInMetres;
  if (is_of(kDepthEncodings)) return RosImageKind::kDepth;
  return is_of(kColorEncodings) ? std::optional(RosImageKind::kColor) : std::nullopt;
}

cv::Mat ColorOf(const RosImage& image) {
  if (image.is_packed) return DecodeColorImage(image.data, "colour");
  const auto [pixels, to_rgb] = Pixels(image, kColorEncodings);
  if (to_rgb < 0) return pixels;
  if (pixels.channels() == 2 && pixels.cols % 2 != 0) WrongSize(image);
  cv::Mat rgb;
  cv::cvtColor(pixels, rgb, to_rgb);
  return rgb;
}

cv::Mat DepthOf(const RosImage& image) {
  if (HasInverseDepth(image)) return UnpackInverse(image);
  if (image.is_packed) return DecodeDepthImage(GreyPng(image), "depth");
  const cv::Mat pixels = Pixels(image, kDepthEncodings).first;
  if (pixels.type() == CV_16UC1) return pixels;
  cv::Mat units(pixels.size(), CV_16UC1, cv::Scalar(0));
  for (int y = 0; y < pixels.rows; ++y)
    for (int x = 0; x < pixels.cols; ++x)
      units.at<std::uint16_t>(y, x) = UnitsOf(pixels.at<float>(y, x));
  return units;
}

}  // namespace plumb
