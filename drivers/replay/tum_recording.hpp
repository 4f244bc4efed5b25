// SPDX-License-Identifier: Apache-2.0
// Streams a recording in the TUM RGB-D layout: a folder with rgb.txt, depth.txt, their images and
// usually camera.yaml.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "algo/types/frame.hpp"
#include "algo/types/marker.hpp"
#include "drivers/replay/camera_file.hpp"
#include "drivers/replay/tum_index.hpp"

namespace plumb {

/// Defaults for everything that a recording does not state.
struct RecordingDefaults {
  RoomMarkers room_markers = {};
  /// Largest difference between the stamps of a colour image and its depth image; 0.55 periods of
  /// the slower stream, if that is more, so that streams of a low rate that are half a period apart
  /// still pair.
  double max_stamp_gap_s = 0.020;
  /// Images a second, for folders of images without time stamps.
  std::optional<double> rate_hz = {};
  /// Units of a depth image per metre where the recording states none, as its markers show them;
  /// without it the median of the depth decides.
  std::optional<double> depth_scale = {};
};

/// The frames of a recording of images, and how their depth was read.
class TumSource : public FrameSource {
 public:
  /// With the unit and the depth camera that were taken, stated or not.
  [[nodiscard]] virtual const CameraFile& camera() const = 0;
};

/// Streams a recording. A separate thread decodes up to three frames ahead, in order, so that
/// decoding overlaps the work on the frames; the result does not depend on timing. Next() and
/// info() must be called from one thread.
///
/// Depth of 65535 units also means "nothing measured" (saturated). Depth that is not registered is
/// registered here, see DepthRegistration.
///
/// Opening reads the index and camera.yaml and finds every image, without decoding any (except the
/// first pair if camera.yaml is missing: a calibration of another program in the folder is
/// then taken, see FindForeignCalibration(), or TUM's published intrinsics are assumed, scaled to
/// its size). Next() throws DataError for an image that is damaged or of another size
/// than the camera; no frames follow.
/// @throws DataError if anything is missing, damaged or contradictory, or there are fewer than two
///         frames.
/// @throws std::invalid_argument if the defaults are invalid.
[[nodiscard]] std::unique_ptr<TumSource> OpenTumRecording(const std::filesystem::path& folder,
                                                          const RecordingDefaults& defaults = {});

/// A recording in another layout, whose lists and camera its reader has found.
struct ImageFolder {
  std::filesystem::path folder;
  std::filesystem::path color_list, depth_list;  ///< Where the entries are from, for messages.
  std::vector<IndexEntry> color, depth;
  std::vector<IndexEntry> fewer_keypoints;  ///< Of `depth`, see kFewerKeypointsFile.
  CameraFile camera;
  bool intrinsics_assumed = false;
  bool depth_is_exr = false;  ///< Depth images are OpenEXR in metres, not PNG in units.
  /// Called on each depth image as stored, which it may change: 0 is no measurement. May be empty;
  /// must be thread-safe.
  std::function<void(const std::filesystem::path& file, cv::Mat& depth)> filter_depth = {};
  std::vector<Message> warnings;
};

/// The same for a recording in another layout.
[[nodiscard]] std::unique_ptr<TumSource> OpenImageFolder(ImageFolder contents,
                                                         const RecordingDefaults& defaults = {});

/// True if the folder looks like a recording: it contains rgb.txt or depth.txt.
[[nodiscard]] bool IsTumRecording(const std::filesystem::path& folder);

}  // namespace plumb
