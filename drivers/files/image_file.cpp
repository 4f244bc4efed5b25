// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/image_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_codecs.hpp"
#include "words/file.hpp"

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

struct KindOfFile {
  std::string_view magic;
  std::size_t at;
  const char* name;
};
using namespace std::string_view_literals;
// Kinds that people have instead of PNG and JPEG, by their first bytes.
constexpr std::array<KindOfFile, 12> kOtherKinds = {{{"II*\0"sv, 0, "TIFF"},
                                                     {"MM\0*"sv, 0, "TIFF"},
                                                     {"P5"sv, 0, "PGM"},
                                                     {"P2"sv, 0, "PGM"},
                                                     {"P6"sv, 0, "PPM"},
                                                     {"Pf"sv, 0, "PFM"},
                                                     {"\x76\x2f\x31\x01"sv, 0, "OpenEXR"},
                                                     {"\x93NUMPY"sv, 0, "NumPy"},
                                                     {"BM"sv, 0, "BMP"},
                                                     {"WEBP"sv, 8, "WebP"},
                                                     {"GIF8"sv, 0, "GIF"},
                                                     {"\xff\xd8\xff"sv, 0, "JPEG"}}};

[[noreturn]] void ThrowUnknownKind(std::span<const std::uint8_t> bytes, const std::string& name,
                                   const Message& expected) {
  if (bytes.empty()) throw DataError(say::file::ImageEmpty(name, expected));
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  for (const KindOfFile& kind : kOtherKinds)
    if (text.size() >= kind.at && text.substr(kind.at).starts_with(kind.magic))
      throw DataError(say::file::ImageOtherKind(name, kind.name, expected));
  std::string found;
  for (const std::uint8_t byte : bytes.first(std::min<std::size_t>(bytes.size(), 4)))
    found += fmt::format("{}{:02x}", found.empty() ? "" : " ", byte);
  throw DataError(say::file::ImageKind(name, expected, found));
}

}  // namespace

namespace codec {

void CheckImageSide(const std::string& name, long width, long height, int max_side) {
  if (width >= 1 && height >= 1 && width <= max_side && height <= max_side) return;
  throw DataError(say::file::ImageSide(name, width, height, max_side));
}

}  // namespace codec

cv::Mat DecodeColorImage(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (StartsWith(bytes, kPngMagic)) return codec::DecodePng(bytes, name, codec::PngKind::kColor);
  if (StartsWith(bytes, kJpegMagic)) return codec::DecodeJpeg(bytes, name);
  ThrowUnknownKind(bytes, name, say::file::PngOrJpeg());
}

cv::Mat ReadColorImage(const std::filesystem::path& path) {
  return DecodeColorImage(ReadWholeFile(path, kMaxImageBytes), path.string());
}

cv::Mat DecodeDepthImage(std::span<const std::uint8_t> bytes, const std::string& name) {
  if (StartsWith(bytes, kPngMagic)) return codec::DecodePng(bytes, name, codec::PngKind::kDepth);
  ThrowUnknownKind(bytes, name, say::file::Png16Bit());
}

cv::Mat ReadDepthImage(const std::filesystem::path& path) {
  return DecodeDepthImage(ReadWholeFile(path, kMaxImageBytes), path.string());
}

cv::Mat ReadExrDepth(const std::filesystem::path& path) {
  return DecodeExrDepth(ReadWholeFile(path, kMaxImageBytes), path.string());
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
