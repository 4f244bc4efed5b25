// Constraints on the poses and the sensor's calibration from overlapping depth images and markers'
// faces: the dense part of RegisterJointly().
#pragma once

#include <stop_token>
#include <vector>

#include "algo/reconstruction/joint_registration.hpp"
#include "algo/sensor_model/depth_field.hpp"

namespace plumb::dense {

/// Positions of the cells of every keyframe in the depth model.
struct Cells {
  std::vector<Eigen::Vector2f> centred;  ///< Centred image coordinates, row by row.
  std::vector<FieldRow> products;
};

/// The cameras under one calibration.
struct Sensor {
  Intrinsics stated;
  Intrinsics corrected;  ///< Of the colour camera.
  Intrinsics depth;      ///< The same with the shift of the depth image.
  double scale = 1;      ///< Pixels of this image per pixel of an image of 640 columns.
};

/// A keyframe under the calibration of the current round.
struct View {
  const MapKeyframe* keyframe = nullptr;
  Pose T_world_depth;
  Pose T_color_depth;
  /// Corrected, in the depth camera's frame; z is 0 where nothing was measured.
  std::vector<Eigen::Vector3f> points;
  const Cells* cells = nullptr;
  int width = 0;
  int height = 0;
};

struct KeyframePair {
  int a = 0;  ///< View whose cells are projected.
  int b = 0;  ///< View into which they are projected.
  double overlap = 0;
};

Cells MakeCells(const Intrinsics& stated, const TrackingMap& map);

Sensor MakeSensor(const Intrinsics& stated, const CalibrationModel& calibration);

/// @param cells, map  Must outlive the views.
std::vector<View> MakeViews(const Sensor& sensor, const CalibrationModel& calibration,
                            const Cells& cells, const TrackingMap& map);

/// Derivative of a cell's point in its own depth camera with the focal lengths, in the first two
/// columns of the lens, and the depth calibration.
Eigen::Matrix<double, 3, kCalibrationSize> CellJacobian(const Sensor& sensor, const View& view,
                                                        std::size_t cell);

/// Pairs of views that overlap enough, at most JointRegistrationOptions::max_pairs for each view.
/// @throws Interrupted on a stop request
std::vector<KeyframePair> FindPairs(const Sensor& sensor, const JointRegistrationOptions& options,
                                    const std::vector<View>& views, const std::stop_token& stop);

/// How many of the cells are used. Coarse: a quarter of those of fine, each with four times the
/// weight; for the early rounds, whose terms only provide a start for the fine ones.
enum class Density { kCoarse, kFine };

/// Point-to-plane residuals of each pair, and of the depth on each marker's face, linearised.
/// @param gate_m  Larger residuals are not correspondences.
/// @param terms  Replaced; its memory is used again.
/// @throws Interrupted on a stop request
void MakeTerms(const Sensor& sensor, const JointRegistrationOptions& options,
               const TrackingMap& map, const std::vector<View>& views,
               const std::vector<KeyframePair>& pairs, double gate_m, Density density,
               const std::stop_token& stop, std::vector<QuadraticTerm>& terms);

/// Median absolute point-to-plane distance of the cells that MakeTerms() never uses, metres; 0
/// without any.
double Consistency(const Sensor& sensor, const std::vector<View>& views,
                   const std::vector<KeyframePair>& pairs, double gate_m);

}  // namespace plumb::dense
