// SPDX-License-Identifier: Apache-2.0
// One sensor that stands still over a scanned body: found by the markers, zeroed on what it sees,
// and watched for its own errors.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "algo/markers/marker_detector.hpp"
#include "algo/monitoring/block_image.hpp"
#include "algo/monitoring/breathing_mode.hpp"
#include "algo/monitoring/motion_fit.hpp"
#include "algo/monitoring/sensor_place.hpp"
#include "algo/monitoring/view_model.hpp"
#include "algo/motion/region.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// What is monitored: the surface of a scene in its reference marker's frame.
struct MonitoredScene {
  /// @param region_polygon_m  As CompareOptions has it.
  /// @throws DataError if the scene has no height map, fewer than four markers or no body.
  MonitoredScene(const Scene& scene, const std::vector<Eigen::Vector2d>& region_polygon_m);

  TriangleMesh mesh;
  MarkerMap markers;
  RoomMarkers room_markers;
  GridShape grid;
  std::vector<std::uint8_t> region;  ///< By cell of the grid.
  SupportPlane support;
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();  ///< Of the region.

  [[nodiscard]] SurfacePart PartOf(const Eigen::Vector3d& p) const;
};

/// Where the sensor is in its work.
enum class RestStage : std::uint8_t { kMounting, kZeroing, kReady };

/// What See() made of a frame: a repetition of the one before, an image, or one by which the
/// sensor's place was checked, too.
enum class SeenImage : std::uint8_t { kRepeated, kTaken, kChecked };

/// What a zero must rest on.
enum class ZeroKind : std::uint8_t { kAny, kOfWholeBreath };

/// One sensor. Not thread-safe; calls are in the order of the frames. Deterministic.
class SensorAtRest {
 public:
  /// @param scene  Must live as long as this object.
  /// @throws DataError if the recording's markers are others than the scene's.
  SensorAtRest(const StreamInfo& info, const MonitoredScene& scene);

  /// Looks for the markers. Once they stood still for a second the sensor's place is known.
  void Mount(const Frame& frame);
  /// Collects a frame of the body at rest.
  void AddStill(const Frame& frame);
  /// Makes the model of the zero from the frames collected.
  /// @return False if the surface does not match what was seen: another scene, or another body; and
  ///         for kOfWholeBreath, as long as it is not sure that one was seen. More frames may then
  ///         be collected, and Zero() called again.
  [[nodiscard]] bool Zero(ZeroKind kind = ZeroKind::kAny);

  /// Of a frame after the zero: averages it, follows the drift, checks the place some times a
  /// second. A frame whose depth equals that of the frame before to the last bit is ignored,
  /// because the noise of a real sensor never repeats. A sensor without noise is recognised while
  /// zeroing, by equal images for longer than kLongestGap_s, and its equal images are used.
  [[nodiscard]] SeenImage See(const Frame& frame);
  /// Call after the sensor was away: what it saw of its place before no longer counts.
  void ForgetPlace();
  /// What See() saw, for a fit that starts at these sizes of the breathing's patterns.
  [[nodiscard]] FitView view(const Eigen::Vector2d& modes_m) const {
    return ViewOf(image_, modes_m);
  }

  [[nodiscard]] RestStage stage() const { return stage_; }
  [[nodiscard]] const SensorPlace& place() const { return place_; }
  [[nodiscard]] const std::optional<BreathingMode>& breathing() const { return breathing_; }
  /// The body's motion from its scan to the zero, measured by depth alone.
  [[nodiscard]] const MotionFit& since_scan() const { return since_scan_; }
  /// Times of the frames that AddStill() collected.
  [[nodiscard]] const std::vector<double>& still_times_s() const { return still_.time_s; }
  /// One of these frames, and what a fit to the model of the zero needs of it. After Zero().
  [[nodiscard]] BlockImage StillImage(std::size_t frame) const;
  [[nodiscard]] FitView StillView(const BlockImage& image, std::size_t frame) const;
  /// Root mean square, in standard deviations of one measurement, of what the sensor measured wrong
  /// at the zero and always does there.
  [[nodiscard]] double static_error() const { return static_error_; }
  /// The same in metres, about its mean: what changes where the body moves away from the zero.
  [[nodiscard]] double static_error_m() const { return static_error_m_; }
  [[nodiscard]] std::size_t frames_in_zero() const { return frames_in_zero_; }
  [[nodiscard]] const PlaceCheck& check() const { return check_; }
  /// Depth now over depth at the zero, of surfaces that stayed where they were.
  [[nodiscard]] double drift() const { return drift_; }
  /// Rise of the support along its normal since the zero, metres; nothing if it is not seen.
  [[nodiscard]] std::optional<double> support_rise_m() const { return support_rise_m_; }

 private:
  struct FaceBlock {
    int marker = 0;
    std::size_t block = 0;
  };

  [[nodiscard]] SeenCorners Detect(const Frame& frame) const;
  /// Whether the sensor has no noise, so that images may be the same for a while.
  [[nodiscard]] bool RepeatedAtZero() const;
  /// Blocks at the body's outline, where a pixel is of one surface or the other: what is measured
  /// wrong there is another error as soon as the body moves.
  void DropOutlines(const std::vector<float>& zero);
  void SetCorrection(const std::vector<float>& zero);
  void FindFaces();
  void FollowDrift(double time_s);
  void CheckPlace(const Frame& frame);
  [[nodiscard]] std::optional<bool> IsBackgroundStill(const Pose& T_now_before) const;
  void MeasureSupport();
  [[nodiscard]] FitView ViewOf(const BlockImage& image, const Eigen::Vector2d& modes_m) const;

  StreamInfo info_;
  const MonitoredScene& scene_;
  BlockGrid grid_;
  MarkerDetector detector_;
  RestStage stage_ = RestStage::kMounting;

  CornerMeans first_half_, second_half_, corners_;
  std::optional<double> mounting_since_s_;
  SensorPlace place_;

  BlockSeries still_;
  MotionFit since_scan_;
  ViewModel model_;       ///< At the zero.
  ViewModel background_;  ///< As the sensor saw everything at the zero.
  std::vector<float> zero_inverse_depth_, correction_;
  std::optional<BreathingMode> breathing_;
  Eigen::Vector2d zero_modes_m_ = Eigen::Vector2d::Zero();
  double static_error_ = 0.0, static_error_m_ = 0.0;
  std::size_t frames_in_zero_ = 0;

  bool is_without_noise_ = false;
  BlockImage image_;
  std::vector<float> recent_;  ///< Inverse depth, low-pass over some tenths of a second.
  std::vector<FaceBlock> faces_;
  double drift_ = 1.0;
  std::optional<double> drift_time_s_, check_time_s_;
  std::optional<PlaceWatch> watch_;
  PlaceCheck check_;
  std::optional<double> support_rise_m_;
};

}  // namespace plumb
