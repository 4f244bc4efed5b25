// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <png.h>

#include <bit>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "algo/base/errors.hpp"
#include "drivers/files/image_codecs.hpp"
#include "drivers/files/image_file.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

constexpr png_alloc_size_t kMaxChunkBytes =
    std::size_t{8}  // for text and profiles, which are not used here
    << 20;
constexpr int kCompressionLevel = 1;

struct PngError {
  char text[160] = "unknown error";
};

void OnError(png_structp png, png_const_charp message) {
  auto* error = static_cast<PngError*>(png_get_error_ptr(png));
  std::snprintf(error->text, sizeof error->text, "%s", message);
  png_longjmp(png, 1);
}

void OnWarning(png_structp, png_const_charp) {}

// ---- reading

/// Bytes to decode and libpng's own structs, which are freed at the end.
struct PngReader {
  std::span<const std::uint8_t> bytes;
  std::size_t offset = 0;
  PngError error;
  png_structp png = nullptr;
  png_infop info = nullptr;

  PngReader() = default;
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
};

void ReadBytes(png_structp png, png_bytep out, png_size_t count) {
  auto* reader = static_cast<PngReader*>(png_get_io_ptr(png));
  if (count > reader->bytes.size() - reader->offset) png_error(png, "the file ends too early");
  std::memcpy(out, reader->bytes.data() + reader->offset, count);
  reader->offset += count;
}

/// Reads all chunks before the pixels. False: reader.error states why.
bool ReadHeader(PngReader& reader) {
  if (setjmp(png_jmpbuf(reader.png))) return false;
  png_set_chunk_malloc_max(reader.png, kMaxChunkBytes);
  png_set_read_fn(reader.png, &reader, ReadBytes);
  png_read_info(reader.png, reader.info);
  return true;
}

/// Requests 8-bit RGB, or 16-bit values in the machine's byte order. False: reader.error states
/// why.
bool SetTransforms(PngReader& reader, codec::PngKind kind) {
  if (setjmp(png_jmpbuf(reader.png))) return false;
  if (kind == codec::PngKind::kDepth) {
    if constexpr (std::endian::native == std::endian::little) png_set_swap(reader.png);
  } else {
    png_set_expand(reader.png);
    png_set_scale_16(reader.png);
    png_set_gray_to_rgb(reader.png);
    png_set_strip_alpha(reader.png);
  }
  png_set_interlace_handling(reader.png);
  png_read_update_info(reader.png, reader.info);
  return true;
}

/// Reads all rows and the chunks after them, so that truncation anywhere is found. False:
/// reader.error states why.
bool ReadRows(PngReader& reader, png_bytepp rows) {
  if (setjmp(png_jmpbuf(reader.png))) return false;
  png_read_image(reader.png, rows);
  png_read_end(reader.png, nullptr);
  return true;
}

[[noreturn]] void ThrowDamaged(const std::string& name, const PngReader& reader) {
  throw DataError(
      say::file::PngDamaged(name, reader.error.text, reader.offset, reader.bytes.size()));
}

void CheckDepthFormat(const std::string& name, const PngReader& reader) {
  const int bits = png_get_bit_depth(reader.png, reader.info);
  const int channels = png_get_channels(reader.png, reader.info);
  if (bits == 16 && png_get_color_type(reader.png, reader.info) == PNG_COLOR_TYPE_GRAY) return;
  throw DataError(say::file::DepthFormat(name, channels, bits));
}

// ---- writing

struct PngWriter {
  std::vector<std::uint8_t> bytes;
  PngError error;
  png_structp png = nullptr;
  png_infop info = nullptr;

  PngWriter() = default;
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;
  ~PngWriter() { png_destroy_write_struct(&png, &info); }
};

void WriteBytes(png_structp png, png_bytep data, png_size_t count) {
  auto* writer = static_cast<PngWriter*>(png_get_io_ptr(png));
  bool out_of_memory = false;
  try {
    writer->bytes.insert(writer->bytes.end(), data, data + count);
  } catch (const std::bad_alloc&) {
    out_of_memory = true;  // no exception may pass through libpng's frames
  }
  if (out_of_memory) png_error(png, "out of memory");
}

void FlushNothing(png_structp) {}

bool WriteRows(PngWriter& writer, int width, int height, int bits, int color_type,
               png_bytepp rows) {
  if (setjmp(png_jmpbuf(writer.png))) return false;
  png_set_write_fn(writer.png, &writer, WriteBytes, FlushNothing);
  png_set_compression_level(writer.png, kCompressionLevel);
  png_set_filter(writer.png, PNG_FILTER_TYPE_BASE, bits == 16 ? PNG_FILTER_UP : PNG_FILTER_SUB);
  png_set_IHDR(writer.png, writer.info, static_cast<png_uint_32>(width),
               static_cast<png_uint_32>(height), bits, color_type, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(writer.png, writer.info);
  if constexpr (std::endian::native == std::endian::little) {
    if (bits == 16) png_set_swap(writer.png);
  }
  png_write_image(writer.png, rows);
  png_write_end(writer.png, nullptr);
  return true;
}

std::vector<png_bytep> RowPointers(const cv::Mat& image) {
  std::vector<png_bytep> rows(static_cast<std::size_t>(image.rows));
  for (int row = 0; row < image.rows; ++row)
    rows[static_cast<std::size_t>(row)] = const_cast<png_bytep>(image.ptr(row));
  return rows;
}

}  // namespace

cv::Mat codec::DecodePng(std::span<const std::uint8_t> bytes, const std::string& name,
                         PngKind kind) {
  PngReader reader;
  reader.bytes = bytes;
  reader.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &reader.error, OnError, OnWarning);
  if (reader.png != nullptr) reader.info = png_create_info_struct(reader.png);
  if (reader.info == nullptr) throw std::bad_alloc();

  if (!ReadHeader(reader)) ThrowDamaged(name, reader);
  const auto width = static_cast<long>(png_get_image_width(reader.png, reader.info));
  const auto height = static_cast<long>(png_get_image_height(reader.png, reader.info));
  CheckImageSide(name, width, height, kMaxImageSide);
  if (kind == PngKind::kDepth) CheckDepthFormat(name, reader);
  if (!SetTransforms(reader, kind)) ThrowDamaged(name, reader);

  cv::Mat image(static_cast<int>(height), static_cast<int>(width),
                kind == PngKind::kDepth ? CV_16UC1 : CV_8UC3);
  if (png_get_rowbytes(reader.png, reader.info) !=
      image.elemSize() * static_cast<std::size_t>(image.cols)) {
    throw DataError(say::file::PixelFormat(name));
  }
  std::vector<png_bytep> rows = RowPointers(image);
  if (!ReadRows(reader, rows.data())) ThrowDamaged(name, reader);
  return image;
}

std::vector<std::uint8_t> EncodePng(const cv::Mat& image) {
  if (image.empty() ||
      (image.type() != CV_8UC1 && image.type() != CV_8UC3 && image.type() != CV_16UC1)) {
    throw std::invalid_argument("EncodePng needs a CV_8UC1, CV_8UC3 or CV_16UC1 image with pixels");
  }
  PngWriter writer;
  writer.bytes.reserve(image.total() * image.elemSize() / 2);
  writer.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &writer.error, OnError, OnWarning);
  if (writer.png != nullptr) writer.info = png_create_info_struct(writer.png);
  if (writer.info == nullptr) throw std::bad_alloc();

  std::vector<png_bytep> rows = RowPointers(image);
  const int color_type = image.channels() == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY;
  if (!WriteRows(writer, image.cols, image.rows, image.depth() == CV_16U ? 16 : 8, color_type,
                 rows.data())) {
    throw std::invalid_argument(
        fmt::format("cannot encode a PNG of {}x{}: {}", image.cols, image.rows, writer.error.text));
  }
  return std::move(writer.bytes);
}

}  // namespace plumb
