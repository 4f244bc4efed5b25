// SPDX-License-Identifier: Apache-2.0
// Writes recordings in the TUM RGB-D layout that OpenTumRecording() reads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "algo/types/frame.hpp"

namespace plumb {

/// Resolution of the stamps in the files.
inline constexpr double kStampStep_s = 1e-6;

struct TumWriterOptions {
  /// Units per metre of the depth images; distances above 65534 units are written as not measured.
  double depth_scale = 5000.0;
  int jpeg_quality = 92;  ///< For the colour images; 0 writes PNG instead.
};

/// One image pair, encoded for the disk.
struct EncodedFrame {
  double color_time_s = 0.0;
  double depth_time_s = 0.0;
  std::vector<std::uint8_t> color_file;
  std::vector<std::uint8_t> depth_file;
  bool fewer_keypoints = false;  ///< As in the frame.
};

/// Compresses one pair. Thread-safe: frames can be encoded in parallel and added in order.
/// @throws std::invalid_argument unless the images are CV_8UC3 and CV_32FC1 (metres) of one size.
[[nodiscard]] EncodedFrame EncodeFrame(const Frame& frame, const TumWriterOptions& options);

/// The text of camera.yaml; ParseCameraFile() gives the same camera back, bit for bit. What is
/// assumed stays so: markers that nothing states are left out, and `assumed` lists the rest.
[[nodiscard]] std::string CameraFileText(const StreamInfo& info, double depth_scale);

/// Writes one recording. Images are written immediately; the indices and camera.yaml are written by
/// Finish(). Without it the folder is not a recording: remove it when stopping early (see
/// daemon/files/atomic_folder.hpp). Not thread-safe.
class TumWriter {
 public:
  /// Creates the folder (its parent must exist) with rgb/ and depth/. @throws IoError
  TumWriter(std::filesystem::path folder, const StreamInfo& info,
            const TumWriterOptions& options = {});

  /// @throws IoError; std::invalid_argument if a stamp is negative or not later than the one before
  /// by a microsecond, the resolution of the files.
  void Add(const EncodedFrame& frame);
  void Add(const Frame& frame) { Add(EncodeFrame(frame, options_)); }

  /// @throws IoError
  void Finish();

 private:
  std::filesystem::path folder_;
  StreamInfo info_;
  TumWriterOptions options_;
  std::string color_index_;
  std::string depth_index_;
  std::string fewer_keypoints_;         ///< The lines of `depth_index_` whose frames are marked.
  std::optional<double> last_color_s_;  // Of the last pair.
  std::optional<double> last_depth_s_;
};

}  // namespace plumb
