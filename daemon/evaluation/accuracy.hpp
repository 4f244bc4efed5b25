// SPDX-License-Identifier: Apache-2.0
// Errors of a reconstruction, an alignment or a motion against the truth. Pure functions without
// files.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/motion/deformation.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/scene.hpp"
#include "daemon/evaluation/number_errors.hpp"
#include "daemon/evaluation/truth.hpp"

namespace plumb {

/// Distribution of errors, in the units of the values.
struct ErrorSummary {
  std::size_t count = 0;
  double mean = 0, median = 0, p95 = 0, max = 0, rms = 0;
};

/// Quantiles interpolate between ranks. All zero for no values.
[[nodiscard]] ErrorSummary Summarise(std::vector<double> values);

/// Rotation error, and the displacement of a given point by the error.
struct MotionError {
  double rotation_deg = 0;
  double translation_mm = 0;
};

/// The body's true motion from scene `reference` to scene `current`, in the true frame of the
/// reference scene's marker: T_marker_world (M_current M_reference^-1) T_world_marker, M =
/// T_world_body.
[[nodiscard]] Pose TrueMotion(const SceneTruth& reference, const SceneTruth& current);

/// Error of an estimated motion (reference-marker frame), with its displacement at the reference
/// body's centroid.
[[nodiscard]] MotionError ErrorOfMotion(const Pose& estimated_motion, const SceneTruth& reference,
                                        const SceneTruth& current);

/// Error of an alignment T_reference_current: at the corners of all true markers (RMS) and at the
/// current body's centroid. `in_true_frames` assumes the true reference-marker frames for both
/// scenes, so it contains the errors of both frames; `in_own_frames` places each scene frame by the
/// fit of its keyframes to the true trajectory.
struct AlignmentError {
  struct Figures {
    double corners_mm = 0;
    double body_mm = 0;
  };
  Figures in_true_frames, in_own_frames;
};

/// A trajectory against the truth after the best rigid fit of the positions (SE3, without scale).
struct TrajectoryError {
  std::size_t count = 0;  ///< Poses with a true pose at their stamp.
  double rmse_mm = 0;     ///< ATE.
  double median_mm = 0;
  double max_mm = 0;
  double rotation_rmse_deg = 0;
  double drift_mm = 0;  ///< Position error of the last pose relative to the first.
  Pose T_world_scene = Pose::Identity();  ///< Pose of the scene's frame by the fit.
};

/// Nothing if fewer than three poses have a true pose or they lie on one line.
[[nodiscard]] std::optional<TrajectoryError> ErrorOfTrajectory(
    std::span<const StampedPose> trajectory, const SceneTruth& truth);

[[nodiscard]] AlignmentError ErrorOfAlignment(const Pose& T_reference_current,
                                              const SceneTruth& reference,
                                              const SceneTruth& current,
                                              const Pose& T_world_reference_scene,
                                              const Pose& T_world_current_scene);

/// How many coordinates of the markers' corners lie within 1.96 sigma_m of the true ones, after the
/// rigid fit of the scene's markers to the true ones, weighted by their sigmas. Markers without a
/// truth are left out. Nothing is counted where the rest determines no fit.
[[nodiscard]] IntervalCount CoverageOfMarkers(const MarkerMap& estimated, const SceneTruth& truth);

/// The true top surface on a grid whose axes are those of `T_world_frame`: heights, NaN off the
/// body or where fewer than `min_frames_seen` frames measured the surface.
[[nodiscard]] HeightMap TrueHeights(const SceneTruth& truth, const GridShape& grid,
                                    const Pose& T_world_frame, double min_frames_seen);

/// Height errors over the visible body, metres converted to mm.
struct HeightError {
  std::size_t count = 0;  ///< Cells compared.
  double bias_mm = 0;     ///< Median of estimate - truth.
  double median_abs_mm = 0;
  double rmse_mm = 0;
  double p95_mm = 0;
  double completeness = 0;  ///< Measured fraction of the visible body's cells, 0..1.
};

[[nodiscard]] HeightError ErrorOfHeights(const HeightMap& estimate, const HeightMap& truth);

/// Distance of the reference body's surface, moved to the current scan, from the true surface: with
/// the rigid motion alone, and with the deformation field too. Millimetres, normal to the surface,
/// over the same samples.
struct DeformationError {
  ErrorSummary rigid_mm, deformed_mm;
};

/// @param true_heights  TrueHeights() of the current scene in the reference marker's frame.
[[nodiscard]] DeformationError ErrorOfDeformation(const Deformation& deformation,
                                                  const Pose& T_motion,
                                                  const HeightMap& true_heights);

/// The small similarity transform of the true surface that explains a height map best, and the
/// remaining error: distinguishes a misplaced frame from a wrong shape or scale. Robust linear
/// least squares on the differences.
struct ShapeError {
  Eigen::Vector3d shift_mm =
      Eigen::Vector3d::Zero();  ///< Displacement of the body's centroid, reference-marker frame.
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();  ///< Rotation vector.
  double scale_permille = 0;                               ///< Growth about the frame's origin.
  HeightError left;                                        ///< Remaining error after the fit.
};

[[nodiscard]] std::optional<ShapeError> ErrorOfShape(const HeightMap& estimate,
                                                     const HeightMap& truth);

}  // namespace plumb
