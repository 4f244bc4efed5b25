// SPDX-License-Identifier: Apache-2.0
// Live monitoring: the body's motion, frame by frame, seen by one or more sensors at rest.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "algo/base/pose.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/monitoring/advice.hpp"
#include "algo/monitoring/live_map.hpp"
#include "algo/monitoring/rest_statistics.hpp"
#include "algo/monitoring/sensor_at_rest.hpp"
#include "algo/types/frame.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

enum class MonitorState : std::uint8_t { kMounting, kZeroing, kMonitoring, kBlind, kMovedSensor };
template <>
inline constexpr auto kNamesOf<MonitorState> = NamesUpTo<MonitorState::kMovedSensor>(
    {"mounting", "zeroing", "monitoring", "blind", "moved_sensor"});

/// Why a frame gives no numbers, or none against the reference.
enum class BlindReason : std::uint8_t {
  kNone,
  kCovered,    ///< Less than 60 % of the region of the zero is seen.
  kWeak,       ///< A direction is determined less than half as well as at the zero.
  kMisfit,     ///< The surface fits much worse than at the zero, or not at all.
  kUnguarded,  ///< Too few markers for 10 s: the sensor may have moved unnoticed.
  kNoZero,     ///< The body was not found where it was scanned; with numbers since zero: elsewhere.
};
template <>
inline constexpr auto kNamesOf<BlindReason> =
    NamesUpTo<BlindReason::kNoZero>({"none", "covered", "weak", "misfit", "unguarded", "no_zero"});

/// How one of several sensors contributes to the numbers.
enum class SensorShare : std::uint8_t {
  kUsed,     ///< They rest on its images; or it is being mounted or zeroed.
  kCovered,  ///< It sees too little of the body, or something else.
  kNoImage,  ///< None for 150 ms.
  kMoved,    ///< It was pushed, and takes no part any more.
  kLeftOut,  ///< It was not zeroed with the others, and takes no part.
};
template <>
inline constexpr auto kNamesOf<SensorShare> =
    NamesUpTo<SensorShare::kLeftOut>({"used", "covered", "no_image", "moved", "left_out"});

/// The accepted result of the scan that is monitored, against its reference.
struct AcceptedMotion {
  Pose T_reference_current = Pose::Identity();           ///< To the frame of the motion.
  Pose T_motion = Pose::Identity();                      ///< Of the body, in that frame.
  Matrix6d covariance = Matrix6d::Zero();                ///< As BodyMotion::covariance.
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();  ///< Of the reference's region.
};

struct MonitorOptions {
  AcceptanceLimits limits;                      ///< Only the tolerances.
  std::optional<Pose> T_iec_reference;          ///< As CompareOptions has it.
  std::optional<AcceptedMotion> accepted = {};  ///< Not set: there is no result to go on from.
  /// The numbers against the reference are judged; without an accepted result they are unknown.
  bool judges_reference = false;
  std::vector<Eigen::Vector2d> region_polygon_m = {};
  /// The zero is the mean over the last whole breath in this time. Where the mount took longer than
  /// usual, zeroing ends before, so that it is done ten seconds after the first frame, if a whole
  /// breath was surely seen.
  double zeroing_s = 8.0;
};

/// What monitoring takes from a configuration; with a reference, the result of the comparison with
/// it. Why there is none is added to the warnings.
[[nodiscard]] MonitorOptions MonitorOptionsOf(const CompareOptions& compare, const Scene* reference,
                                              const Scene& current, std::vector<Message>& warnings);

/// One frame's numbers. What is not known is absent.
struct MonitorLine {
  double time_s = 0.0;     ///< Stamp of the depth image.
  std::size_t sensor = 0;  ///< That took it.
  int sensors_used = 0;    ///< Whose images the numbers rest on.
  MonitorState state = MonitorState::kMounting;
  LiveAdvice advice = LiveAdvice::kUnknown;
  std::optional<LiveNumbers> since_zero = {};         ///< Motion of the body, at its centroid.
  std::optional<LiveNumbers> against_reference = {};  ///< Likewise, from the reference on.
  std::optional<double> breathing_m = {};             ///< Belly above the end of expiration.
  std::optional<double> support_rise_m = {};
  double visible = 0.0;   ///< Share of the region of the zero, 0 to 1.
  double residual = 0.0;  ///< Against that at the zero: 1 is as good.
  double drift = 1.0;     ///< Depth now over depth at the zero, of what stayed.
  int markers_seen = 0;
  BlindReason reason = BlindReason::kNone;
  bool couch_moved = false;  ///< Markers moved, but the sensor did not.
  /// False: its image was not judged, since others go on without this sensor.
  bool takes_part = true;
};

/// Runs sensors from their mounting on. Frames in the order of their stamps, which are of one
/// clock. Not thread-safe; no threads; the same frames give the same bits.
///
/// Each sensor has its own place, zero, drift and breathing; of those that see enough at a time the
/// normal equations are summed. All that are mounted within a second are zeroed together; one that
/// is not, or that is pushed, takes no part any more.
class Monitor {
 public:
  /// @param scene    Of the body as it lies, just scanned; in its reference marker's frame.
  /// @param sensors  At least one; more than two take long to zero, since each set of them has its
  ///        own uncertainty.
  /// @throws DataError if the scene cannot be monitored, or a stream's markers are others.
  Monitor(const Scene& scene, std::span<const StreamInfo> sensors, const MonitorOptions& options);
  Monitor(const Scene& scene, const StreamInfo& info, const MonitorOptions& options)
      : Monitor(scene, std::span(&info, 1), options) {}
  Monitor(const Monitor&) = delete;
  Monitor& operator=(const Monitor&) = delete;

  /// @return Nothing for a frame of a sensor that takes no part while another one does, and for a
  ///         repetition of the previous image (see SensorAtRest::See()).
  [[nodiscard]] std::optional<MonitorLine> Add(const Frame& frame, std::size_t sensor = 0);
  /// The line of such a frame: unknown, and why that sensor takes no part. It carries no
  /// advice; the other sensors continue.
  [[nodiscard]] MonitorLine LineAside(const Frame& frame, std::size_t sensor) const;

  [[nodiscard]] const MonitoredScene& scene() const { return scene_; }
  [[nodiscard]] std::size_t num_sensors() const { return sensors_.size(); }
  [[nodiscard]] const SensorAtRest& sensor(std::size_t i = 0) const { return sensors_[i].at_rest; }
  /// Whether it was zeroed.
  [[nodiscard]] bool takes_part(std::size_t i) const { return sensors_[i].takes_part; }
  /// As of the last frame.
  [[nodiscard]] SensorShare share(std::size_t i) const;
  /// Of the newest image of each sensor that may be used, whether or not they give numbers; nothing
  /// before the zero, and where there is none.
  [[nodiscard]] std::optional<LiveMap> Map() const;
  /// Standard deviations of a single frame's motion while zeroing, about the centroid, by all
  /// sensors together: rotation vector, translation.
  [[nodiscard]] Vector6d spread_at_zero() const;
  /// Time of the first frame after the zero.
  [[nodiscard]] std::optional<double> zero_time_s() const { return zero_time_s_; }

 private:
  struct Sensor {
    SensorAtRest at_rest;
    bool takes_part = true;
    bool moved = false;  ///< It was pushed and has lost its zero for good.
    std::optional<double> image_s = {}, markers_s = {};  ///< Last image, last one with markers.
    int checks_due = 0;  ///< Of its place, since it was away: only then it is used again.
    Eigen::Vector2d modes_m = Eigen::Vector2d::Zero();
  };
  enum class Stage : std::uint8_t { kMounting, kZeroing, kFitting, kFollowing };

  void Mount(Sensor& sensor, const Frame& frame);
  void Collect(Sensor& sensor, const Frame& frame);
  /// @param last  There will be no other: also without a breath.
  void TakeZeros(bool last);
  void FitSome();
  /// @return False for a repeated image.
  [[nodiscard]] bool Follow(Sensor& sensor, const Frame& frame, MonitorLine& line);
  [[nodiscard]] SensorSet SensorsThatMaySee(double time_s) const;
  /// Fits all that see enough; those that do not leave the set.
  [[nodiscard]] std::optional<MotionFit> FitAll(SensorSet& set, MonitorLine& line);
  [[nodiscard]] BlindReason JudgeOne(std::size_t sensor, const ViewFit& fit,
                                     double residual_at_rest, double time_s) const;
  [[nodiscard]] Matrix6d CovarianceOf(const MotionFit& fit, const SensorSet& set,
                                      std::size_t frames) const;
  /// Since zero, over the last frames that agree with the newest; and their number.
  [[nodiscard]] std::pair<Pose, std::size_t> MeanMotion(double time_s, const MotionFit& fit,
                                                        const RestStatistics& at_rest);
  /// Mean of the sensors of a set that see a breathing; nothing without one.
  [[nodiscard]] std::optional<double> Breathing_m(const SensorSet& set) const;
  [[nodiscard]] LiveNumbers AgainstReference(const Pose& T_motion,
                                             const Matrix6d& covariance) const;

  MonitorOptions options_;
  MonitoredScene scene_;
  std::deque<Sensor> sensors_;
  AdviceFilter advice_;
  Stage stage_ = Stage::kMounting;
  std::optional<double> first_s_, mounted_since_s_, zeroing_since_s_, zero_tried_s_, zero_time_s_;
  bool no_zero_ = false;
  bool moved_since_scan_ = false;  ///< By any sensor that was zeroed.
  std::optional<RestFits> rest_fits_;
  std::size_t fits_at_a_time_ = 1;
  std::map<SensorSet, RestStatistics> at_rest_;

  Pose T_last_ = Pose::Identity();
  SensorSet last_set_;
  SensorSet used_;  ///< Of the last frame.
  double last_s_ = 0.0;
  std::vector<std::pair<double, Vector6d>> recent_;  ///< Times and twists since zero.
};

/// The numbers of a motion, axes as those of a correction; but it is the motion, not what to apply
/// against it.
/// @param covariance  Rotation vector and translation, left perturbation about the moved point.
[[nodiscard]] LiveNumbers NumbersOfMotion(const Pose& T_motion, const Matrix6d& covariance,
                                          const Eigen::Vector3d& point,
                                          const std::optional<Pose>& T_iec_reference);

}  // namespace plumb
