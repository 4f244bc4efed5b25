// SPDX-License-Identifier: Apache-2.0
// A binary recording of another program: what it states, and its images one by one. Opened in
// plumb-file-reader only, a process of its own; file_recording.hpp is what the programs use.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>

#include "algo/base/message.hpp"

namespace plumb {

/// Random access to the bytes of a file.
struct FileBytes {
  std::uint64_t size = 0;
  /// False if the file is shorter, or cannot be read.
  std::function<bool(std::uint64_t offset, std::span<std::uint8_t> bytes)> read;
};

/// What a recording states besides its images.
struct RecordedFacts {
  std::string format;                  ///< Such as "RealSense .bag".
  std::string name, serial, firmware;  ///< Of the sensor; empty where nothing states it.
  nlohmann::ordered_json camera = nlohmann::ordered_json::object();  ///< Keys of camera.yaml.
  std::vector<double> color_s, depth_s;  ///< Stamps of the images; they rise strictly.
  std::optional<double> stereo_baseline_m;
  std::vector<Message> warnings;  ///< What is missing, assumed or left out.
};

/// Most images that a recording may have.
inline constexpr std::size_t kMostRecordedImages = 1'000'000;

class RecordedFile {
 public:
  virtual ~RecordedFile() = default;
  [[nodiscard]] virtual const RecordedFacts& facts() const = 0;
  /// CV_8UC3, channels red, green, blue. @throws DataError for a damaged image.
  [[nodiscard]] virtual cv::Mat Color(std::size_t i) = 0;
  /// CV_16UC1, units as stored. @throws DataError
  [[nodiscard]] virtual cv::Mat Depth(std::size_t i) = 0;
};

}  // namespace plumb
