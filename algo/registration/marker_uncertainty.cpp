// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/marker_uncertainty.hpp"

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "algo/types/marker.hpp"

namespace plumb {
namespace {

constexpr Eigen::Index kTwist = 6;
constexpr Eigen::Index kCoordinates = 12;  // Of a marker's four corners.
// By how much markers err more than the posterior states, because residuals share errors outside
// the model. The residuals themselves do not show it: over 22 simulated sweeps the scatter of a
// marker's corners in the images had no correlation with its error in space. The factor is the
// root mean square over seven units (45 and 91 to 94 of this simulator, sim-a and sim-b of another
// one; 1.02 to 1.88), rounded; see docs/method-measurements.md.
constexpr double kErrorByPosterior = 1.6;
// Standard deviation of a marker's position above which its observations do not determine it.
constexpr double kUndetermined_m = 0.1;
// Rounds of the weighted fit. In the first one all weights are equal, so that a poorly determined
// marker spoils the others; in the third it no longer does. Further rounds would concentrate the
// weight on a few markers.
constexpr int kWeightRounds = 3;

// The markers that the posterior determines, and how their corners in the world move.
struct Markers {
  std::vector<int> ids;
  Eigen::MatrixXd twists;  // Covariance, 6 by 6 for each pair.
  Eigen::MatrixXd J;       // Of the stacked corners with respect to the twists.
  Eigen::MatrixXd rigid;   // Of the stacked corners with respect to a motion of all of them.

  [[nodiscard]] auto size() const { return static_cast<Eigen::Index>(ids.size()); }
};

Markers Determined(const BundlePosterior& posterior, const TrackingMap& map, double length_m) {
  Markers markers;
  std::vector<Eigen::Index> rows;
  Eigen::Index at = 0;
  for (const auto& [id, row] : posterior.marker_rows) {
    const double variance = posterior.of_markers.diagonal().segment<3>(at + 3).maxCoeff();
    if (variance < kUndetermined_m * kUndetermined_m) {
      markers.ids.push_back(id);
      for (Eigen::Index i = 0; i < kTwist; ++i) rows.push_back(at + i);
    }
    at += kTwist;
  }
  markers.twists = posterior.of_markers(rows, rows);
  markers.J = Eigen::MatrixXd::Zero(kCoordinates * markers.size(), kTwist * markers.size());
  markers.rigid.resize(kCoordinates * markers.size(), kTwist);
  const MarkerCorners corners = CornersInMarkerFrame(length_m);
  // Near the markers, for the sake of rounding only.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  if (!markers.ids.empty())
    centre = map.markers.at(markers.ids.front()).T_world_marker.translation();
  for (Eigen::Index m = 0; m < markers.size(); ++m) {
    const Pose& T = map.markers.at(markers.ids[static_cast<std::size_t>(m)]).T_world_marker;
    for (Eigen::Index i = 0; i < 4; ++i) {
      const Eigen::Vector3d& corner = corners[static_cast<std::size_t>(i)];
      const Eigen::Index row = kCoordinates * m + 3 * i;
      markers.J.block<3, 3>(row, kTwist * m) = -T.linear() * Skew(corner);
      markers.J.block<3, 3>(row, kTwist * m + 3) = T.linear();
      markers.rigid.block<3, 3>(row, 0) = -Skew(T * corner - centre);
      markers.rigid.block<3, 3>(row, 3).setIdentity();
    }
  }
  return markers;
}

// Variance of one coordinate of each marker's corners, after a fit with the weights.
Eigen::VectorXd OwnVariances(const Markers& markers, const Eigen::VectorXd& weights) {
  const Eigen::MatrixXd weighted =
      weights.replicate(1, kCoordinates).transpose().reshaped().asDiagonal() * markers.rigid;
  const Eigen::LDLT<Matrix6d> normal(markers.rigid.transpose() * weighted);
  const Eigen::MatrixXd own =
      markers.J - markers.rigid * normal.solve(weighted.transpose() * markers.J);
  const Eigen::VectorXd variances = (own * markers.twists).cwiseProduct(own).rowwise().sum();
  Eigen::VectorXd of_markers(markers.size());
  for (Eigen::Index m = 0; m < markers.size(); ++m) {
    const Eigen::Index at = kCoordinates * m;
    // Of its six degrees of freedom the fit takes this fraction; over all markers it adds up to 1.
    const Matrix6d seen = markers.rigid.middleRows<kCoordinates>(at).transpose() *
                          weighted.middleRows<kCoordinates>(at);
    const double hidden = normal.solve(seen).trace() / kTwist;
    of_markers[m] = variances.segment<kCoordinates>(at).mean() / (1.0 - hidden);
  }
  return of_markers;
}

}  // namespace

std::map<int, double> MarkerSigmas(const BundlePosterior& posterior, const TrackingMap& map,
                                   double marker_length_m) {
  std::map<int, double> sigmas;
  if (posterior.of_markers.size() == 0) return sigmas;
  const Markers markers = Determined(posterior, map, marker_length_m);
  Eigen::VectorXd variances;
  if (markers.size() == 1) {
    const Eigen::MatrixXd corners = markers.J * markers.twists * markers.J.transpose();
    variances.setConstant(1, corners.trace() / kCoordinates);
  } else if (markers.size() > 1) {
    Eigen::VectorXd weights = Eigen::VectorXd::Ones(markers.size());
    for (int round = 0; round < kWeightRounds; ++round) {
      variances = OwnVariances(markers, weights);
      weights = variances.cwiseInverse();
    }
  }
  for (Eigen::Index m = 0; m < markers.size(); ++m) {
    // Rounding may spoil a variance where one marker has nearly all the weight.
    if (!(variances[m] > 0) || !std::isfinite(variances[m])) continue;
    sigmas[markers.ids[static_cast<std::size_t>(m)]] = kErrorByPosterior * std::sqrt(variances[m]);
  }
  return sigmas;
}

}  // namespace plumb
