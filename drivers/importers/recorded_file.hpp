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

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message.hpp"
#include "words/foreign.hpp"

namespace plumb {

/// Random access to the bytes of a file.
struct FileBytes {
  std::uint64_t size = 0;
  /// False if the file is shorter, or cannot be read.
  std::function<bool(std::uint64_t offset, std::span<std::uint8_t> bytes)> read;
};

/// @throws DataError for what is no rotation, such as the zeros that some drivers leave.
[[nodiscard]] inline Eigen::Quaterniond RotationOf(const Eigen::Matrix3d& stated) {
  if (!((stated * stated.transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-3) ||
      !(stated.determinant() > 0))
    throw DataError(say::foreign::Rotation());
  return Eigen::Quaterniond(stated).normalized();
}

/// What a recording states besides its images.
struct RecordedFacts {
  std::string format;                  ///< Such as "RealSense .bag".
  std::string name, serial, firmware;  ///< Of the sensor; empty where nothing states it.
  std::string class_by;  ///< The name that the class was guessed by; empty: it was not guessed.
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
