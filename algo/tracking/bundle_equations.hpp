// The normal equations of a bundle adjustment at one state.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "algo/tracking/bundle_problem.hpp"

namespace plumb::bundle {

inline constexpr int kLensAndReadout = kReadoutAt + 1;
using CameraPoint = Eigen::Matrix<double, kCamera, 3>;

/// Linearised observation of a keypoint, with weighted rows pixel x, pixel y and depth.
struct PointRows {
  Eigen::Vector3d r = Eigen::Vector3d::Zero();
  Eigen::Matrix3d J_point = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, kCamera> J_camera = Eigen::Matrix<double, 3, kCamera>::Zero();
  /// Derivatives to lens and readout.
  Eigen::Matrix<double, 2, kLensAndReadout> J_lens =
      Eigen::Matrix<double, 2, kLensAndReadout>::Zero();
  DepthRow J_depth = DepthRow::Zero();

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

/// Parallel loops write to their own slots and every sum has a fixed order: the same bits on any
/// number of threads.
class Equations {
 public:
  /// @param problem  Must outlive this object.
  explicit Equations(const Problem& problem);

  /// Computes all of the members below.
  void Linearise(const State& state);

  /// One for each of Problem::views().
  [[nodiscard]] const std::vector<PointRows>& rows() const { return rows_; }
  /// Normal equations of poses, markers and calibration, undamped, lower half; landmarks are not
  /// yet eliminated.
  [[nodiscard]] const Eigen::MatrixXd& H() const { return H_; }
  [[nodiscard]] const Eigen::VectorXd& g() const { return g_; }

 private:
  void LineariseKeyframe(const State& state, std::size_t k, CalibrationMatrix& H_calibration,
                         CalibrationVector& g_calibration);
  [[nodiscard]] PointRows RowsOf(const State& state, const PointView& view) const;
  void AddCorner(const State& state, const CornerView& view);
  void AddTerm(const State& state, const QuadraticTerm& term);

  const Problem& problem_;
  std::vector<PointRows> rows_;
  Eigen::MatrixXd H_;
  Eigen::VectorXd g_;
};

}  // namespace plumb::bundle
