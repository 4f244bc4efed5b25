// One RGB-D image pair, and the interface of its sources.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/types/depth_noise.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// One colour image and its depth image. The images are reference counted: clone one before
/// changing it.
struct Frame {
  std::int64_t index = 0;     ///< Position of the pair in the recording, from 0.
  double color_time_s = 0.0;  ///< Stamp of the colour image: mid-exposure of its middle row.
  double depth_time_s =
      0.0;            ///< Stamp of the depth image; the time of the pose that Plumb reports.
  cv::Mat color_rgb;  ///< CV_8UC3, channels red, green, blue.
  cv::Mat depth_m;    ///< CV_32FC1, metres along the optical axis, 0 where nothing was measured.
                      ///< Registered to the colour image, same size.
};

/// Properties of a stream that are known before its first frame.
struct StreamInfo {
  Intrinsics intrinsics;        ///< Of the colour camera (and therefore of the registered depth).
  DepthNoise depth_noise = {};  ///< Of the sensor; structured light unless stated otherwise.
  bool intrinsics_assumed = false;  ///< The recording has no calibration; nominal values are used.
  /// OpenCV's name, or DICT_ARUCO_MIP_36h12.
  std::string marker_dictionary = kDefaultMarkerDictionary;
  double marker_length_m = kDefaultMarkerLength_m;  ///< Side of the black square.
  std::optional<int> reference_marker;     ///< Id of the marker whose frame is the scene's frame.
  std::optional<std::int64_t> num_frames;  ///< Number of image pairs, if known beforehand.
  std::vector<std::string> warnings;       ///< Assumptions and omissions of the source.
};

/// A stream of frames in order. Not thread-safe: read from one thread.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  [[nodiscard]] virtual const StreamInfo& info() const = 0;
  /// The next frame, or nothing at the end. Blocks while a device is slow.
  /// @throws DataError for damaged data, DeviceError for a failing device.
  [[nodiscard]] virtual std::optional<Frame> Next() = 0;
};

}  // namespace plumb
