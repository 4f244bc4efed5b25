// One RGB-D image pair, and where a stream of them comes from.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"

namespace plumb {

/// One colour image and the depth image that belongs to it.
/// The images are reference counted: clone one before changing it.
struct Frame {
  std::int64_t index = 0;     ///< Position of the pair in the recording, from 0.
  double color_time_s = 0.0;  ///< Stamp of the colour image: mid-exposure of its middle row.
  double depth_time_s =
      0.0;            ///< Stamp of the depth image; the time of the pose that Plumb reports.
  cv::Mat color_rgb;  ///< CV_8UC3, channels red, green, blue.
  cv::Mat depth_m;    ///< CV_32FC1, metres along the optical axis, 0 where nothing was measured.
                      ///< Registered to the colour image, same size.
};

/// Everything that is known of a stream before its first frame.
struct StreamInfo {
  Intrinsics intrinsics;            ///< Of the colour camera (and so of the registered depth).
  bool intrinsics_assumed = false;  ///< No calibration came with the recording: nominal values.
  std::string marker_dictionary = "DICT_6X6_250";  ///< OpenCV's name, or DICT_ARUCO_MIP_36h12.
  double marker_length_m = 0.104;                  ///< Side of the black square.
  std::optional<int> reference_marker;     ///< Id of the marker whose frame is the scene's frame.
  std::optional<std::int64_t> num_frames;  ///< Image pairs, where known beforehand.
  std::vector<std::string> warnings;       ///< What the source assumed or left out.
};

/// A stream of frames, in order. Not thread-safe: one thread reads.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  [[nodiscard]] virtual const StreamInfo& info() const = 0;
  /// Next frame, or nothing at the end. Blocks while a device is slow.
  /// @throws DataError on damaged data, DeviceError on a failing device.
  [[nodiscard]] virtual std::optional<Frame> Next() = 0;
};

}  // namespace plumb
