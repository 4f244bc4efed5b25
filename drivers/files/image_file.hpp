// SPDX-License-Identifier: Apache-2.0
// Image files through libpng, libjpeg and libtiff directly, OpenEXR by own code: strict (a damaged
// image is never partly accepted) and with limited sizes.
//
// Decoders take bytes and a name for messages. All functions are thread-safe and deterministic.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace plumb {

/// Largest width and height that a reader accepts; checked in the header, before memory is
/// allocated.
inline constexpr int kMaxImageSide = 4096;
/// Largest side of a TIFF grid (a height map of 4 m at 1 mm has 4000 cells a side).
inline constexpr int kMaxGridSide = 16384;

/// A colour image, PNG or JPEG by its first bytes. Palette, grey, alpha and 16-bit PNG become 8-bit
/// RGB.
/// @return CV_8UC3, channels red, green, blue.
/// @throws DataError naming the file if it is missing, of another kind, damaged, truncated or too
/// large.
[[nodiscard]] cv::Mat ReadColorImage(const std::filesystem::path& path);
[[nodiscard]] cv::Mat DecodeColorImage(std::span<const std::uint8_t> bytes,
                                       const std::string& name);

/// A depth image: a PNG with one 16-bit channel and nothing else.
/// @return CV_16UC1, units as stored.
/// @throws DataError as above, and if the PNG has 8 bits or another number of channels.
[[nodiscard]] cv::Mat ReadDepthImage(const std::filesystem::path& path);
[[nodiscard]] cv::Mat DecodeDepthImage(std::span<const std::uint8_t> bytes,
                                       const std::string& name);

/// A depth image as OpenEXR, in metres, as phones' apps write it: scan lines without compression,
/// by runs or by zlib; the channel Z, else R, else Y, else the only one; 16- or 32-bit floats.
/// @return CV_32FC1; 0 where the value is not finite or not positive.
/// @throws DataError as above, and for any other kind of OpenEXR.
[[nodiscard]] cv::Mat ReadExrDepth(const std::filesystem::path& path);
[[nodiscard]] cv::Mat DecodeExrDepth(std::span<const std::uint8_t> file, const std::string& name);

/// CV_8UC1 (grey), CV_8UC3 (RGB) or CV_16UC1 (depth) as PNG, compressed fast rather than small.
/// @throws std::invalid_argument on another type or an empty image; IoError if the file cannot be
/// written.
void WritePng(const std::filesystem::path& path, const cv::Mat& image);
[[nodiscard]] std::vector<std::uint8_t> EncodePng(const cv::Mat& image);

/// CV_8UC3 (RGB) as baseline JPEG; quality 1 to 100.
/// @throws std::invalid_argument as WritePng().
[[nodiscard]] std::vector<std::uint8_t> EncodeJpeg(const cv::Mat& rgb, int quality);

/// CV_32FC1 as an uncompressed single-channel IEEE float TIFF; NaN is preserved.
/// @throws std::invalid_argument, IoError as WritePng().
void WriteFloatTiff(const std::filesystem::path& path, const cv::Mat& values);
[[nodiscard]] std::vector<std::uint8_t> EncodeFloatTiff(const cv::Mat& values);

/// A single-channel float32 TIFF in strips. @return CV_32FC1.
/// @throws DataError naming the file if it is missing, of another kind, damaged, truncated or too
/// large.
[[nodiscard]] cv::Mat ReadFloatTiff(const std::filesystem::path& path);
[[nodiscard]] cv::Mat DecodeFloatTiff(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace plumb
