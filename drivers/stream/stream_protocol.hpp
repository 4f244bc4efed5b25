// SPDX-License-Identifier: Apache-2.0
// The messages that carry frames from any program to Plumb: README.md in this folder. Also written
// by plumb-file-reader, the child process that opens recordings of other programs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>

#include "drivers/replay/camera_file.hpp"

namespace plumb::stream {

inline constexpr int kVersion = 1;
/// Longest first message of a feeder; a recording's states the stamps of all of its images too.
inline constexpr std::size_t kMaxHello = std::size_t{1} << 16;
inline constexpr std::size_t kMaxRecordedHello = std::size_t{1} << 26;
/// The feeder may deliver this many pairs a second.
inline constexpr double kLeastRate_hz = 1.0, kMostRate_hz = 120.0;

enum class Kind : std::uint32_t {
  kHello = 1,  ///< JSON; the first message, and only that one.
  kColor = 2,  ///< The pixels of a colour image, row by row, without padding.
  kDepth = 3,  ///< Of a depth image: 16 bits a pixel, little-endian.
  kEnd = 4,    ///< Of a recording: no more images. Its size is 0.
  kError = 5,  ///< Of a recording's reader: ReaderErrorText().
};

/// What precedes every message's payload: numbers are little-endian, as on every machine that Plumb
/// runs on.
struct Header {
  std::array<char, 4> magic = {'P', 'L', 'M', 'B'};
  std::uint32_t kind = 0;
  std::uint64_t size = 0;     ///< Bytes of the payload.
  std::int64_t stamp_us = 0;  ///< Of an image: mid-exposure, both streams by one clock.
};
static_assert(sizeof(Header) == 24);

/// The first message, validated.
struct Hello {
  std::string name, serial;
  double rate_hz = 30.0;
  bool is_bgr = false;         ///< Colour images have their channels in the order blue, green, red.
  nlohmann::json camera_keys;  ///< The camera as it was stated: the keys of camera.yaml.
  CameraFile camera;           ///< Its depth_scale is set, and the depth camera is known.
  nlohmann::json recording;    ///< Of a recording: what else it states.

  /// The camera that the depth images are from.
  [[nodiscard]] const Intrinsics& depth_intrinsics() const {
    return camera.depth_camera ? camera.depth_camera->intrinsics : camera.color;
  }
};

/// @param incomplete  Also accepts a camera without unit, or with an unknown depth camera, as
///                    recordings may have.
/// @throws DataError for another protocol or version, unknown keys, and what ParseCameraFile()
///         refuses.
[[nodiscard]] Hello ParseHello(std::string_view text, bool incomplete = false);

/// The kind of the message; nothing if the header does not belong to the protocol.
[[nodiscard]] std::optional<Kind> KindOf(const Header& header);

/// An empty image for the payload of an image message, of exactly its size: CV_8UC3 or CV_16UC1.
/// @throws DataError if the size that the header states is another.
[[nodiscard]] cv::Mat ImageFor(Kind kind, std::uint64_t size, const Hello& hello);

}  // namespace plumb::stream
