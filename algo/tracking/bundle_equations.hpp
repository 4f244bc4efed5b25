// The normal equations of a bundle adjustment at one state.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "algo/tracking/bundle_problem.hpp"

namespace plumb::bundle {

inline constexpr int kLensAndReadout = kReadoutAt + 1;
using CameraPoint = Eigen::Matrix<double, kCamera, 3>;

/// Linearised observation of a keypoint, with weighted rows pixel x, pixel y and depth. Not
/// initialised, because there are tens of thousands, of which parallel loops fill each.
struct PointRows {
  Eigen::Vector3d r;
  Eigen::Matrix3d J_point;
  Eigen::Matrix<double, 3, kCamera> J_camera;
  Eigen::Matrix<double, 2, kLensAndReadout> J_lens;  ///< Derivatives to lens and readout.
  DepthRow J_depth;

  /// J' M for this observation's derivatives J with respect to the whole calibration.
  template <int kColumns>
  [[nodiscard]] Eigen::Matrix<double, kCalibrationSize, kColumns> CalibrationTimes(
      const Eigen::Matrix<double, 3, kColumns>& M) const {
    Eigen::Matrix<double, kCalibrationSize, kColumns> product;
    product.template topRows<kLensAndReadout>().noalias() =
        J_lens.transpose() * M.template topRows<2>();
    product.row(kEdgeBiasAt).setZero();
    product.template bottomRows<CalibrationModel::kDepthSize>().noalias() =
        J_depth.transpose() * M.row(2);
    return product;
  }
};

// Unknowns of the calibration that affect marker corners.
inline constexpr int kSeenByCorners = kEdgeBiasAt + 1;

/// Linearised observation of a marker's corner, weighted.
struct CornerRows {
  Eigen::Vector2d r;
  Eigen::Matrix<double, 2, 6> J_marker;
  Eigen::Matrix<double, 2, kCamera> J_camera;
  Eigen::Matrix<double, 2, kSeenByCorners> J_calibration;
};

/// Parallel loops write to their own slots and every sum has a fixed order: the same bits on any
/// number of threads.
class Equations {
 public:
  /// @param problem  Must outlive this object.
  explicit Equations(const Problem& problem);

  /// Computes all of the members below.
  void Linearise(const State& state);

  /// One for each of Problem::views.
  [[nodiscard]] const std::vector<PointRows>& rows() const { return rows_; }
  /// Normal equations of poses, markers and calibration, undamped, lower half; landmarks are not
  /// yet eliminated.
  [[nodiscard]] const Eigen::MatrixXd& H() const { return H_; }
  [[nodiscard]] const Eigen::VectorXd& g() const { return g_; }

 private:
  void LineariseKeyframe(const State& state, std::size_t k, CalibrationMatrix& H_calibration,
                         CalibrationVector& g_calibration);
  [[nodiscard]] PointRows RowsOf(const State& state, const PointView& view) const;
  [[nodiscard]] CornerRows RowsOf(const State& state, const CornerView& view) const;
  // The corners that one keyframe sees: its own pose and its coupling to the markers.
  void AddCornersOfKeyframe(std::size_t k, CalibrationMatrix& H_calibration,
                            CalibrationVector& g_calibration);
  void AddCornersOfMarker(std::size_t slot);
  /// @param slope  H x + g of the term at the state.
  void AddTerm(const QuadraticTerm& term, const Problem::TermVector& slope);

  const Problem& problem_;
  std::vector<PointRows> rows_;
  std::vector<CornerRows> corner_rows_;
  Eigen::MatrixXd H_;
  Eigen::VectorXd g_;
};

}  // namespace plumb::bundle
