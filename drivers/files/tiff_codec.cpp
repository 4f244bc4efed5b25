// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <tiffio.h>

#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>

#include "algo/base/errors.hpp"
#include "drivers/files/image_codecs.hpp"
#include "drivers/files/image_file.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxCells = std::size_t{1} << 25;  // 128 MiB of floats
constexpr tmsize_t kMaxSingleAllocation = tmsize_t{256} << 20;
constexpr std::uint32_t kRowsPerStrip = 64;

/// A TIFF in memory, as seen by libtiff's client functions.
struct Stream {
  std::span<const std::uint8_t> in;          ///< Used for reading.
  std::vector<std::uint8_t>* out = nullptr;  ///< Used for writing.
  std::uint64_t position = 0;
  char error[200] = "unknown error";

  [[nodiscard]] std::uint64_t size() const { return out != nullptr ? out->size() : in.size(); }
};

tmsize_t StreamRead(thandle_t handle, void* data, tmsize_t count) {
  auto* stream = static_cast<Stream*>(handle);
  if (count <= 0 || stream->position >= stream->size()) return 0;
  const std::uint64_t take =
      std::min<std::uint64_t>(static_cast<std::uint64_t>(count), stream->size() - stream->position);
  const std::uint8_t* begin = stream->out != nullptr ? stream->out->data() : stream->in.data();
  std::memcpy(data, begin + stream->position, take);
  stream->position += take;
  return static_cast<tmsize_t>(take);
}

tmsize_t StreamWrite(thandle_t handle, void* data, tmsize_t count) {
  auto* stream = static_cast<Stream*>(handle);
  if (stream->out == nullptr || count <= 0) return 0;
  const std::uint64_t end = stream->position + static_cast<std::uint64_t>(count);
  try {
    if (end > stream->out->size()) stream->out->resize(end);
  } catch (const std::bad_alloc&) {
    return 0;  // no exception may pass through libtiff's frames; it reports a short write
  }
  std::memcpy(stream->out->data() + stream->position, data, static_cast<std::size_t>(count));
  stream->position = end;
  return count;
}

toff_t StreamSeek(thandle_t handle, toff_t offset, int whence) {
  auto* stream = static_cast<Stream*>(handle);
  if (whence == SEEK_CUR) offset += stream->position;
  if (whence == SEEK_END) offset += stream->size();
  stream->position = offset;
  return offset;
}

int StreamClose(thandle_t) { return 0; }
toff_t StreamSize(thandle_t handle) { return static_cast<Stream*>(handle)->size(); }

int OnError(TIFF*, void* user, const char* module, const char* format, va_list arguments) {
  auto* stream = static_cast<Stream*>(user);
  const int used = std::snprintf(stream->error, sizeof stream->error,
                                 "%s: ", module != nullptr ? module : "libtiff");
  if (used > 0 && static_cast<std::size_t>(used) < sizeof stream->error) {
    std::vsnprintf(stream->error + used, sizeof stream->error - static_cast<std::size_t>(used),
                   format, arguments);
  }
  return 1;  // handled, so that nothing is printed on stderr
}

int OnWarning(TIFF*, void*, const char*, const char*, va_list) { return 1; }

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using TiffHandle = std::unique_ptr<TIFF, CloseTiff>;

TiffHandle Open(Stream& stream, const char* mode) {
  TIFFOpenOptions* options = TIFFOpenOptionsAlloc();
  if (options == nullptr) throw std::bad_alloc();
  TIFFOpenOptionsSetErrorHandlerExtR(options, OnError, &stream);
  TIFFOpenOptionsSetWarningHandlerExtR(options, OnWarning, &stream);
  TIFFOpenOptionsSetMaxSingleMemAlloc(options, kMaxSingleAllocation);
  TIFF* tiff = TIFFClientOpenExt("memory", mode, &stream, StreamRead, StreamWrite, StreamSeek,
                                 StreamClose, StreamSize, nullptr, nullptr, options);
  TIFFOpenOptionsFree(options);
  return TiffHandle(tiff);
}

[[noreturn]] void ThrowDamaged(const std::string& name, const Stream& stream) {
  throw DataError(say::file::TiffDamaged(name, stream.in.size(), stream.error));
}

}  // namespace

cv::Mat DecodeFloatTiff(std::span<const std::uint8_t> bytes, const std::string& name) {
  Stream stream;
  stream.in = bytes;
  const TiffHandle tiff = Open(stream, "rm");
  if (tiff == nullptr) ThrowDamaged(name, stream);

  std::uint32_t width = 0;
  std::uint32_t height = 0;
  TIFFGetField(tiff.get(), TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff.get(), TIFFTAG_IMAGELENGTH, &height);
  codec::CheckImageSide(name, static_cast<long>(width), static_cast<long>(height), kMaxGridSide);
  std::uint16_t bits = 0;
  std::uint16_t channels = 0;
  std::uint16_t format = 0;
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, &channels);
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_SAMPLEFORMAT, &format);
  if (bits != 32 || channels != 1 || format != SAMPLEFORMAT_IEEEFP ||
      TIFFIsTiled(tiff.get()) != 0) {
    throw DataError(TIFFIsTiled(tiff.get()) != 0
                        ? say::file::TiffTiled(name, channels, bits, format)
                        : say::file::TiffFormat(name, channels, bits, format));
  }
  // Uncompressed pixels cannot be larger than the file, so a header with wrong sizes is found
  // before memory is allocated.
  std::uint16_t compression = COMPRESSION_NONE;
  TIFFGetFieldDefaulted(tiff.get(), TIFFTAG_COMPRESSION, &compression);
  const std::size_t num_cells = static_cast<std::size_t>(width) * height;
  const std::size_t max_cells = compression == COMPRESSION_NONE
                                    ? std::min(kMaxCells, bytes.size() / sizeof(float))
                                    : kMaxCells;
  if (num_cells > max_cells) {
    throw DataError(say::file::TiffTruncated(name, bytes.size(), width, height, max_cells));
  }
  cv::Mat values(static_cast<int>(height), static_cast<int>(width), CV_32FC1);
  if (TIFFScanlineSize(tiff.get()) != static_cast<tmsize_t>(width * sizeof(float)))
    ThrowDamaged(name, stream);
  for (std::uint32_t row = 0; row < height; ++row) {
    if (TIFFReadScanline(tiff.get(), values.ptr(static_cast<int>(row)), row, 0) != 1)
      ThrowDamaged(name, stream);
  }
  return values;
}

std::vector<std::uint8_t> EncodeFloatTiff(const cv::Mat& values) {
  if (values.empty() || values.type() != CV_32FC1)
    throw std::invalid_argument("EncodeFloatTiff needs a CV_32FC1 image with pixels");
  std::vector<std::uint8_t> bytes;
  bytes.reserve(values.total() * sizeof(float) + 4096);
  Stream stream;
  stream.out = &bytes;
  bool good = true;
  {
    const TiffHandle tiff = Open(stream, "wl");  // little-endian everywhere
    if (tiff == nullptr)
      throw std::invalid_argument(fmt::format("cannot encode a TIFF: {}", stream.error));
    TIFFSetField(tiff.get(), TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(values.cols));
    TIFFSetField(tiff.get(), TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(values.rows));
    TIFFSetField(tiff.get(), TIFFTAG_BITSPERSAMPLE, 32);
    TIFFSetField(tiff.get(), TIFFTAG_SAMPLESPERPIXEL, 1);
    TIFFSetField(tiff.get(), TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
    TIFFSetField(tiff.get(), TIFFTAG_COMPRESSION, COMPRESSION_NONE);
    TIFFSetField(tiff.get(), TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    TIFFSetField(tiff.get(), TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff.get(), TIFFTAG_ROWSPERSTRIP, kRowsPerStrip);
    for (int row = 0; row < values.rows && good; ++row) {
      good = TIFFWriteScanline(tiff.get(), const_cast<std::uint8_t*>(values.ptr(row)),
                               static_cast<std::uint32_t>(row), 0) == 1;
    }
    good = good && TIFFFlush(tiff.get()) == 1;
  }
  if (!good)
    throw std::runtime_error(
        fmt::format("cannot encode a TIFF of {}x{}: {}", values.cols, values.rows, stream.error));
  return bytes;
}

}  // namespace plumb
