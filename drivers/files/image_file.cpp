#include "drivers/files/image_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_codecs.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxImageBytes = std::size_t{128}
                                       << 20;  // 4096 x 4096 x 3 x 16 bit is 96 MiB
constexpr std::size_t kMaxTiffBytes = std::size_t{1} << 30;

constexpr std::array<std::uint8_t, 8> kPngMagic = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::array<std::uint8_t, 3> kJpegMagic = {0xff, 0xd8, 0xff};

template <std::size_t N>
bool StartsWith(std::span<const std::uint8_t> bytes, const std::array<std::uint8_t, N>& magic) {
  return bytes.size() >= N && std::equal(magic.begin(), magic.end(), bytes.begin());
}

[[noreturn]] void ThrowUnknownKind(std::span<const std::uint8_t> bytes, const std::string& name,
                                   const char* expected) {
  if (bytes.empty()) throw DataError(fmt::format("image {} is empty, expected {}", name, expected));
  std::string found;
  for (const std::uint8_t byte : bytes.first(std::min<std::size_t>(bytes.size(), 4)))
    found += fmt::format(" {:02x}", byte);
  throw DataError(
      fmt::format("image {} is not a {}: its first bytes are{}", name, expected, found));
}

}  // namespace

namespace codec {

void CheckImageSide(const std::string& name, long width, long height, int max_side) {
  if (width >= 1 && height >= 1 && width <= max_side && height <= max_side) return;
  throw DataError(fmt::format("image {} states {}x{} pixels, expected 1 to {} pixels per side",
                              name, width, height, max_side));
}

}  // namespace codec

cv::Mat DecodeColorImage(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (StartsWith(bytes, kPngMagic)) return codec::DecodePng(bytes, name, codec::PngKind::kColor);
  if (StartsWith(bytes, kJpegMagic)) return codec::DecodeJpeg(bytes, name);
  ThrowUnknownKind(bytes, name, "PNG or JPEG");
}

cv::Mat ReadColorImage(const std::filesystem::path& path) {
  return DecodeColorImage(ReadWholeFile(path, kMaxImageBytes), path.string());
}

cv::Mat DecodeDepthImage(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (StartsWith(bytes, kPngMagic)) return codec::DecodePng(bytes, name, codec::PngKind::kDepth);
  ThrowUnknownKind(bytes, name, "16-bit PNG");
}

cv::Mat ReadDepthImage(const std::filesystem::path& path) {
  return DecodeDepthImage(ReadWholeFile(path, kMaxImageBytes), path.string());
}

cv::Mat ReadFloatTiff(const std::filesystem::path& path) {
  return DecodeFloatTiff(ReadWholeFile(path, kMaxTiffBytes), path.string());
}

void WritePng(const std::filesystem::path& path, const cv::Mat& image) {
  WriteWholeFile(path, EncodePng(image));
}

void WriteFloatTiff(const std::filesystem::path& path, const cv::Mat& values) {
  WriteWholeFile(path, EncodeFloatTiff(values));
}

}  // namespace plumb
