// SPDX-License-Identifier: Apache-2.0
// OpenEXR as phones' apps write depth: one part of scan lines, without compression, by runs (RLE)
// or by zlib (ZIPS, ZIP). Own code, because only a small part of a large format is needed. The
// bytes are not trusted, so all of them are read through a bounded reader.
#include <zlib.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string_view>

#include "algo/base/errors.hpp"
#include "drivers/files/image_codecs.hpp"
#include "drivers/files/image_file.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

constexpr std::uint32_t kExrMagic = 20000630;
constexpr std::uint32_t kExrVersion = 2, kLongNames = 0x400;
constexpr std::size_t kMaxExrName = 255, kMaxExrAttributes = 1000, kMaxExrChannels = 8;
constexpr std::int32_t kExrHalf = 1, kExrFloat = 2;

enum ExrCompression : std::uint8_t { kExrNone, kExrRle, kExrZipLine, kExrZip };

class ExrBytes {
 public:
  ExrBytes(std::span<const std::uint8_t> bytes, const std::string& name)
      : left_(bytes), name_(name) {}
  [[nodiscard]] std::size_t left() const { return left_.size(); }
  [[noreturn]] void Refuse(const Message& why) const {
    throw DataError(say::file::ExrDamaged(name_, why));
  }
  std::span<const std::uint8_t> Take(std::size_t count) {
    if (count > left_.size()) Refuse(say::file::ExrShort());
    const auto taken = left_.first(count);
    left_ = left_.subspan(count);
    return taken;
  }
  template <typename Number>
  Number Get() {
    static_assert(std::endian::native == std::endian::little);
    Number number{};
    std::memcpy(&number, Take(sizeof number).data(), sizeof number);
    return number;
  }
  /// A text that ends with a zero byte.
  std::string_view Text() {
    const std::string_view text(reinterpret_cast<const char*>(left_.data()),
                                std::min(left_.size(), kMaxExrName + 1));
    const std::size_t length = text.find('\0');
    if (length == std::string_view::npos) Refuse(say::file::ExrShort());
    (void)Take(length + 1);
    return text.substr(0, length);
  }

 private:
  std::span<const std::uint8_t> left_;
  const std::string& name_;
};

struct ExrHeader {
  int width = 0, height = 0;
  std::int32_t top = 0;  ///< Number of the first line.
  ExrCompression compression = kExrNone;
  std::size_t line_bytes = 0;    ///< Of all channels.
  std::size_t depth_at = 0;      ///< Of depth's samples in a line.
  std::int32_t depth_type = -1;  ///< kExrHalf or kExrFloat.
  [[nodiscard]] int lines_per_chunk() const { return compression == kExrZip ? 16 : 1; }
};

std::size_t SampleBytes(std::int32_t type) { return type == kExrHalf ? 2 : 4; }

// Z if there is one, else R, else Y, else the only one.
int RankOf(std::string_view channel) {
  if (channel == "Z") return 3;
  if (channel == "R") return 2;
  return channel == "Y" ? 1 : 0;
}

// Needs the width, which may come behind the channels.
void PlaceChannels(ExrBytes channels, ExrHeader& header) {
  int best = -1;
  std::size_t count = 0;
  for (std::string_view name = channels.Text(); !name.empty(); name = channels.Text()) {
    const auto type = channels.Get<std::int32_t>();
    (void)channels.Take(4);
    const auto step_x = channels.Get<std::int32_t>(), step_y = channels.Get<std::int32_t>();
    if (type < 0 || type > kExrFloat || step_x != 1 || step_y != 1 || ++count > kMaxExrChannels)
      channels.Refuse(say::file::ExrLayout());
    if (type != 0 && RankOf(name) > best) {
      best = RankOf(name);
      header.depth_at = header.line_bytes;
      header.depth_type = type;
    }
    header.line_bytes += SampleBytes(type) * static_cast<std::size_t>(header.width);
  }
  if (best < 0 || (best == 0 && count > 1)) channels.Refuse(say::file::ExrLayout());
}

ExrHeader ReadExrHeader(ExrBytes& bytes, const std::string& name) {
  if (bytes.Get<std::uint32_t>() != kExrMagic) bytes.Refuse(say::file::ExrLayout());
  // Tiles, deep images and several parts have flags of their own.
  if ((bytes.Get<std::uint32_t>() & ~kLongNames) != kExrVersion)
    bytes.Refuse(say::file::ExrLayout());
  ExrHeader header;
  std::optional<std::span<const std::uint8_t>> channels;
  bool has_window = false, has_compression = false;
  std::size_t count = 0;
  for (std::string_view key = bytes.Text(); !key.empty(); key = bytes.Text()) {
    (void)bytes.Text();  // The type follows from the name.
    const auto size = bytes.Get<std::uint32_t>();
    ExrBytes value(bytes.Take(size), name);
    if (++count > kMaxExrAttributes) bytes.Refuse(say::file::ExrLayout());
    if (key == "channels") channels = value.Take(size);
    if (key == "compression") {
      const auto kind = value.Get<std::uint8_t>();
      if (kind > kExrZip) throw DataError(say::file::ExrCompression(name, kind));
      header.compression = static_cast<ExrCompression>(kind);
      has_compression = true;
    }
    if (key == "dataWindow") {
      const std::int64_t left = value.Get<std::int32_t>(), top = value.Get<std::int32_t>();
      const std::int64_t right = value.Get<std::int32_t>(), bottom = value.Get<std::int32_t>();
      codec::CheckImageSide(name, right - left + 1, bottom - top + 1, kMaxImageSide);
      header.width = static_cast<int>(right - left + 1);
      header.height = static_cast<int>(bottom - top + 1);
      header.top = static_cast<std::int32_t>(top);
      has_window = true;
    }
  }
  if (!channels || !has_window || !has_compression) bytes.Refuse(say::file::ExrLayout());
  PlaceChannels(ExrBytes(*channels, name), header);
  return header;
}

// Runs: a count n >= 0 and a byte that occurs n + 1 times, or -n bytes as they are.
bool UnpackRuns(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) {
  std::size_t at = 0, filled = 0;
  while (at < packed.size()) {
    const auto count = static_cast<std::int8_t>(packed[at++]);
    const std::size_t length =
        count < 0 ? static_cast<std::size_t>(-count) : static_cast<std::size_t>(count) + 1;
    const std::size_t needed = count < 0 ? length : 1;
    if (needed > packed.size() - at || length > out.size() - filled) return false;
    if (count < 0) {
      std::memcpy(out.data() + filled, packed.data() + at, length);
    } else {
      std::memset(out.data() + filled, packed[at], length);
    }
    at += needed;
    filled += length;
  }
  return filled == out.size();
}

bool Inflate(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) {
  auto size = static_cast<uLongf>(out.size());
  return ::uncompress(out.data(), &size, packed.data(), static_cast<uLong>(packed.size())) ==
             Z_OK &&
         size == out.size();
}

// Packed bytes are differences, of the even bytes first.
std::vector<std::uint8_t> Reordered(std::vector<std::uint8_t> bytes) {
  for (std::size_t i = 1; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::uint8_t>(bytes[i - 1] + bytes[i] - 128);
  std::vector<std::uint8_t> ordered(bytes.size());
  const std::size_t half = (bytes.size() + 1) / 2;
  for (std::size_t i = 0; i < bytes.size(); ++i)
    ordered[i] = bytes[i % 2 == 0 ? i / 2 : half + i / 2];
  return ordered;
}

float HalfValue(std::uint16_t half) {
  const int exponent = (half >> 10) & 31;
  const int fraction = half & 1023;
  if (exponent == 31) return 0.0F;  // Not a number, or infinite: not measured.
  const float size = exponent == 0 ? std::ldexp(static_cast<float>(fraction), -24)
                                   : std::ldexp(static_cast<float>(1024 + fraction), exponent - 25);
  return (half & 0x8000) != 0 ? -size : size;
}

void TakeLine(const ExrHeader& header, const std::uint8_t* line, float* depth_m) {
  const std::uint8_t* sample = line + header.depth_at;
  for (int c = 0; c < header.width; ++c, sample += SampleBytes(header.depth_type)) {
    float value = 0.0F;
    if (header.depth_type == kExrHalf) {
      std::uint16_t half = 0;
      std::memcpy(&half, sample, sizeof half);
      value = HalfValue(half);
    } else {
      std::memcpy(&value, sample, sizeof value);
    }
    depth_m[c] = std::isfinite(value) && value > 0 ? value : 0.0F;
  }
}

}  // namespace

cv::Mat DecodeExrDepth(std::span<const std::uint8_t> file, const std::string& name) {
  ExrBytes bytes(file, name);
  const ExrHeader header = ReadExrHeader(bytes, name);
  const int per_chunk = header.lines_per_chunk();
  const int num_chunks = (header.height + per_chunk - 1) / per_chunk;
  (void)bytes.Take(8 *
                   static_cast<std::size_t>(num_chunks));  // Where they are; each says its line.
  cv::Mat depth_m(header.height, header.width, CV_32FC1);
  std::vector<bool> seen(static_cast<std::size_t>(num_chunks));
  for (int chunk = 0; chunk < num_chunks; ++chunk) {
    const std::int64_t row = std::int64_t{bytes.Get<std::int32_t>()} - header.top;
    const auto packed = bytes.Take(bytes.Get<std::uint32_t>());
    if (row < 0 || row >= header.height || row % per_chunk != 0 ||
        seen[static_cast<std::size_t>(row / per_chunk)])
      bytes.Refuse(say::file::ExrLines());
    seen[static_cast<std::size_t>(row / per_chunk)] = true;
    const int lines = std::min(per_chunk, header.height - static_cast<int>(row));
    const std::size_t size = header.line_bytes * static_cast<std::size_t>(lines);
    std::vector<std::uint8_t> unpacked(size);
    if (packed.size() == size) {  // What would not become smaller is stored as it is.
      std::memcpy(unpacked.data(), packed.data(), size);
    } else if (header.compression == kExrNone ||
               !(header.compression == kExrRle ? UnpackRuns(packed, unpacked)
                                               : Inflate(packed, unpacked))) {
      bytes.Refuse(say::file::ExrLines());
    } else {
      unpacked = Reordered(std::move(unpacked));
    }
    for (int line = 0; line < lines; ++line)
      TakeLine(header, unpacked.data() + header.line_bytes * static_cast<std::size_t>(line),
               depth_m.ptr<float>(static_cast<int>(row) + line));
  }
  return depth_m;
}

}  // namespace plumb
