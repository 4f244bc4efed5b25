// SPDX-License-Identifier: Apache-2.0
// jpeglib.h needs FILE and size_t to be declared before it.
#include <cstddef>
#include <cstdio>
// clang-format off
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include <fmt/format.h>

#include <csetjmp>
#include <cstdlib>
#include <stdexcept>

#include "algo/base/errors.hpp"
#include "drivers/files/image_codecs.hpp"
#include "drivers/files/image_file.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

/// A progressive file may contain any number of scans; encoders write about ten.
constexpr int kMaxScans = 64;

struct ErrorManager {
  jpeg_error_mgr base;  ///< Must be first: libjpeg returns a pointer to it.
  std::jmp_buf target;
  char text[JMSG_LENGTH_MAX];
};

void OnFatal(j_common_ptr info) {
  auto* error = reinterpret_cast<ErrorManager*>(info->err);
  (*info->err->format_message)(info, error->text);
  std::longjmp(error->target, 1);
}

/// libjpeg continues after damage (level -1) and fills the rest with grey. Here only warnings that
/// cost no pixels are accepted.
void OnMessage(j_common_ptr info, int level) {
  if (level >= 0) return;
  const int code = info->err->msg_code;
  if (code == JWRN_EXTRANEOUS_DATA || code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR) return;
  OnFatal(info);
}

void OnProgress(j_common_ptr info) {
  if (info->is_decompressor == FALSE) return;
  if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMaxScans) return;
  auto* error = reinterpret_cast<ErrorManager*>(info->err);
  std::snprintf(error->text, sizeof error->text, "more than %d scans", kMaxScans);
  std::longjmp(error->target, 1);
}

jpeg_error_mgr* Prepare(ErrorManager& error) {
  jpeg_std_error(&error.base);
  error.base.error_exit = OnFatal;
  error.base.emit_message = OnMessage;
  return &error.base;
}

// ---- reading

struct JpegReader {
  ErrorManager error{};
  jpeg_progress_mgr progress{};
  jpeg_decompress_struct info{};

  JpegReader() {
    info.err = Prepare(error);
    progress.progress_monitor = OnProgress;
  }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;
  ~JpegReader() { jpeg_destroy_decompress(&info); }
};

bool ReadHeader(JpegReader& reader, const std::uint8_t* bytes, std::size_t size) {
  if (setjmp(reader.error.target)) return false;
  jpeg_create_decompress(&reader.info);
  reader.info.progress = &reader.progress;
  jpeg_mem_src(&reader.info, bytes, size);
  jpeg_read_header(&reader.info, TRUE);
  reader.info.out_color_space = JCS_RGB;
  return true;
}

bool ReadRows(JpegReader& reader, std::uint8_t* pixels, std::size_t stride) {
  if (setjmp(reader.error.target)) return false;
  jpeg_start_decompress(&reader.info);
  while (reader.info.output_scanline < reader.info.output_height) {
    JSAMPROW row = pixels + reader.info.output_scanline * stride;
    jpeg_read_scanlines(&reader.info, &row, 1);
  }
  jpeg_finish_decompress(&reader.info);
  return true;
}

[[noreturn]] void ThrowDamaged(const std::string& name, const JpegReader& reader,
                               std::size_t size) {
  throw DataError(say::file::JpegDamaged(name, reader.error.text, size));
}

// ---- writing

struct JpegWriter {
  ErrorManager error{};
  jpeg_compress_struct info{};
  unsigned char* bytes = nullptr;  ///< Allocated by libjpeg with malloc.
  unsigned long size = 0;

  JpegWriter() { info.err = Prepare(error); }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;
  ~JpegWriter() {
    jpeg_destroy_compress(&info);
    std::free(bytes);
  }
};

bool WriteRows(JpegWriter& writer, const cv::Mat& rgb, int quality) {
  if (setjmp(writer.error.target)) return false;
  jpeg_create_compress(&writer.info);
  jpeg_mem_dest(&writer.info, &writer.bytes, &writer.size);
  writer.info.image_width = static_cast<JDIMENSION>(rgb.cols);
  writer.info.image_height = static_cast<JDIMENSION>(rgb.rows);
  writer.info.input_components = 3;
  writer.info.in_color_space = JCS_RGB;
  jpeg_set_defaults(&writer.info);
  jpeg_set_quality(&writer.info, quality, TRUE);
  jpeg_start_compress(&writer.info, TRUE);
  while (writer.info.next_scanline < writer.info.image_height) {
    auto* row = const_cast<JSAMPROW>(rgb.data + writer.info.next_scanline * rgb.step.p[0]);
    jpeg_write_scanlines(&writer.info, &row, 1);
  }
  jpeg_finish_compress(&writer.info);
  return true;
}

}  // namespace

cv::Mat codec::DecodeJpeg(std::span<const std::uint8_t> bytes, const std::string& name) {
  JpegReader reader;
  if (!ReadHeader(reader, bytes.data(), bytes.size())) ThrowDamaged(name, reader, bytes.size());
  CheckImageSide(name, static_cast<long>(reader.info.image_width),
                 static_cast<long>(reader.info.image_height), kMaxImageSide);
  const J_COLOR_SPACE space = reader.info.jpeg_color_space;
  if (space != JCS_GRAYSCALE && space != JCS_RGB && space != JCS_YCbCr) {
    throw DataError(say::file::JpegComponents(name, reader.info.num_components));
  }
  cv::Mat image(static_cast<int>(reader.info.image_height),
                static_cast<int>(reader.info.image_width), CV_8UC3);
  if (!ReadRows(reader, image.data, image.step[0])) ThrowDamaged(name, reader, bytes.size());
  return image;
}

std::vector<std::uint8_t> EncodeJpeg(const cv::Mat& rgb, int quality) {
  if (rgb.empty() || rgb.type() != CV_8UC3)
    throw std::invalid_argument("EncodeJpeg needs a CV_8UC3 image with pixels");
  if (quality < 1 || quality > 100)
    throw std::invalid_argument(fmt::format("JPEG quality is 1 to 100, got {}", quality));
  JpegWriter writer;
  if (!WriteRows(writer, rgb, quality)) {
    throw std::invalid_argument(
        fmt::format("cannot encode a JPEG of {}x{}: {}", rgb.cols, rgb.rows, writer.error.text));
  }
  return {writer.bytes, writer.bytes + writer.size};
}

}  // namespace plumb
