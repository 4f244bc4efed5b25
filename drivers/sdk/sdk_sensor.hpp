// SPDX-License-Identifier: Apache-2.0
// What open cameras of makers' libraries share: two streams with the factory's calibration, each
// image as the camera sends it.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/pose.hpp"
#include "drivers/live/boxed_sensor.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/sdk/sdk_host.hpp"

namespace plumb {

inline constexpr int kSdkRate_hz = 30;
/// Automatic exposure settles within half a second.
inline constexpr int kSdkPairsToSettle = 15;

/// One camera's calibration, as the factory states it, at the size of its images.
struct SdkLens {
  int width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::vector<double> distortion = {};  ///< In OpenCV's order.
  bool is_equidistant = false;          ///< Colour only: OpenCV's fisheye model.
};

struct SdkFactory {
  SdkLens color, depth;
  Pose T_color_depth = Pose::Identity();
  double depth_unit_m = 0.0;
};

/// A pose from what libraries state in single precision, which is not rigid enough.
[[nodiscard]] Pose RigidPose(const Eigen::Matrix3f& turn, const Eigen::Vector3f& shift_m);

/// Colour images of more than 960 columns are delivered with half the size.
[[nodiscard]] cv::Size SdkColorSize(int width, int height);

/// Place in the order of preference of images of this size; nothing for one that is not used.
[[nodiscard]] std::optional<std::size_t> SdkRank(std::span<const cv::Size> sizes, int width,
                                                 int height);

/// Images that a camera sends go into the box, reduced to SdkColorSize().
struct SdkImage {
  StreamKind kind = StreamKind::kColor;
  int width = 0, height = 0;
  std::size_t row_bytes = 0;
  bool has_format = false;  ///< RGB of 24 bits, or depth of 16.
  const void* data = nullptr;
};
/// Whether it is of the size and format that were asked for. Otherwise the box fails, with what
/// was found.
[[nodiscard]] bool IsWanted(FrameBox& box, const std::string& serial, const SdkImage& image,
                            int wanted_width, int wanted_height);
/// Copies it, because the library takes its buffer back.
[[nodiscard]] cv::Mat CopyOf(const SdkImage& image);

/// A sensor of which only the streams differ. Its constructor sets calibration and class: those of
/// the unit's own file, else the factory's.
class SdkSensor : public BoxedSensor {
 protected:
  /// @throws DeviceError if the calibration cannot be used.
  SdkSensor(SdkOpening opening, const SensorSettings& settings, const SdkTitle& title,
            const SdkFactory& factory);
  [[nodiscard]] double exposure_us() const { return exposure_us_; }

 private:
  const double exposure_us_;
  std::shared_ptr<const void> watched_;
};

}  // namespace plumb
