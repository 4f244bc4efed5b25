// SPDX-License-Identifier: Apache-2.0
// One RGB-D image pair, and the interface of its sources.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/message.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "algo/sensor_model/depth_sensor.hpp"
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
  /// The computer was too slow for all keypoints when this pair came, see Tracker::Track().
  bool fewer_keypoints = false;
};

/// Properties of a stream that are known before its first frame.
struct StreamInfo {
  Intrinsics intrinsics;  ///< Of the colour camera (and therefore of the registered depth).
  /// Class of the depth camera; decides what is expected of its calibration and its edges.
  DepthSensor depth_sensor = DepthSensor::kStructuredLight;
  DepthNoise depth_noise = {};      ///< Of the sensor; that of its class unless stated otherwise.
  UsableDepth usable_depth = {};    ///< Likewise.
  bool intrinsics_assumed = false;  ///< The recording has no calibration; nominal values are used.
  bool depth_unit_assumed = false;  ///< Nothing states the unit of the depth images.
  bool depth_unit_open = false;     ///< Likewise, and another may be given to the reader.
  double depth_units_per_metre = 0.0;  ///< The unit that was taken; 0: the source has metres.
  /// Depth is not registered to colour, nothing says where its camera is, and the images do not
  /// show it: the frames have depth as if it were registered.
  bool depth_camera_unknown = false;
  bool depth_camera_estimated = false;  ///< Depth was registered with a camera from the images.
  /// What nothing states of `room_markers`.
  bool dictionary_assumed = false, marker_length_assumed = false;
  RoomMarkers room_markers = {};
  std::optional<std::int64_t> num_frames;  ///< Number of image pairs, if known beforehand.
  std::vector<Message> warnings;           ///< Assumptions and omissions of the source.
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
