// How far a reconstruction, an alignment or a motion is from the truth. Pure functions: no files.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/comparison/deformation.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/scene.hpp"
#include "daemon/evaluation/truth.hpp"

namespace plumb {

/// Distribution of errors; units are those of the values.
struct ErrorSummary {
  std::size_t count = 0;
  double mean = 0, median = 0, p95 = 0, max = 0, rms = 0;
};

/// Quantiles interpolate between ranks. All zero for no values.
[[nodiscard]] ErrorSummary Summarise(std::vector<double> values);

/// Rotation error, and how far the error displaces a named point.
struct MotionError {
  double rotation_deg = 0;
  double translation_mm = 0;
};

/// The body's true motion from scene `reference` to scene `current`, in the true frame of the
/// reference scene's marker: T_marker_world (M_current M_reference^-1) T_world_marker, M =
/// T_world_body.
[[nodiscard]] Pose TrueMotion(const SceneTruth& reference, const SceneTruth& current);

/// Error of an estimated motion (reference-marker frame), its displacement taken at the reference
/// body's centroid.
[[nodiscard]] MotionError ErrorOfMotion(const Pose& estimated_motion, const SceneTruth& reference,
                                        const SceneTruth& current);

/// Error of an alignment T_reference_current: at the corners of all true markers (RMS) and at the
/// current body's centroid. `in_true_frames` takes both scene frames for the true reference-marker
/// frames, so it holds the errors of both frames; `in_own_frames` places each scene frame where its
/// own keyframes fit the true trajectory.
struct AlignmentError {
  struct Figures {
    double corners_mm = 0;
    double body_mm = 0;
  };
  Figures in_true_frames, in_own_frames;
};

/// A trajectory against the truth after the best rigid (SE3, no scale) fit of the positions.
struct TrajectoryError {
  std::size_t count = 0;  ///< Poses with a true pose at their stamp.
  double rmse_mm = 0;     ///< ATE.
  double median_mm = 0;
  double max_mm = 0;
  double rotation_rmse_deg = 0;
  double drift_mm = 0;  ///< Position error of the last pose relative to the first.
  Pose T_world_scene = Pose::Identity();  ///< Where the fit places the scene's frame.
};

/// Nothing if fewer than three poses have a truth or they lie on one line.
[[nodiscard]] std::optional<TrajectoryError> ErrorOfTrajectory(
    std::span<const StampedPose> trajectory, const SceneTruth& truth);

[[nodiscard]] AlignmentError ErrorOfAlignment(const Pose& T_reference_current,
                                              const SceneTruth& reference,
                                              const SceneTruth& current,
                                              const Pose& T_world_reference_scene,
                                              const Pose& T_world_current_scene);

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
  double completeness = 0;  ///< Measured share of the visible body's cells, 0..1.
};

[[nodiscard]] HeightError ErrorOfHeights(const HeightMap& estimate, const HeightMap& truth);

/// How far the reference body's surface, moved to the current scan, lies from the true surface
/// there: with the rigid motion alone, and with the deformation field too. Millimetres, across the
/// surface; both over the same samples.
struct DeformationError {
  ErrorSummary rigid_mm, deformed_mm;
};

/// @param true_heights  TrueHeights() of the current scene in the reference marker's frame.
[[nodiscard]] DeformationError ErrorOfDeformation(const Deformation& deformation,
                                                  const Pose& T_motion,
                                                  const HeightMap& true_heights);

/// Which small similarity transform of the true surface explains a height map best, and what it
/// leaves: tells a misplaced frame from a wrong shape or scale. Robust linear least squares on the
/// differences.
struct ShapeError {
  Eigen::Vector3d shift_mm =
      Eigen::Vector3d::Zero();  ///< Of the body's centroid, reference-marker frame.
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();  ///< Rotation vector.
  double scale_permille = 0;                               ///< Growth about the frame's origin.
  HeightError left;                                        ///< After the fit.
};

[[nodiscard]] std::optional<ShapeError> ErrorOfShape(const HeightMap& estimate,
                                                     const HeightMap& truth);

}  // namespace plumb
