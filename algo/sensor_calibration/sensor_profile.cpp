// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/sensor_profile.hpp"

#include <Eigen/Cholesky>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

CalibrationMatrix Inverse(const CalibrationMatrix& m, const Message& unusable) {
  const Eigen::LLT<CalibrationMatrix> solver(m);
  const CalibrationMatrix inverse = solver.solve(CalibrationMatrix::Identity());
  if (solver.info() != Eigen::Success || !inverse.allFinite()) throw DataError(unusable);
  return 0.5 * (inverse + inverse.transpose());
}

}  // namespace

// While a unit warms up, the scale of its depth may change by 0.6 % (simulated: 0.6 % exp(-t / 10
// min)), of which two sweeps 100 s apart differ by 0.09 % at most, within the 0.1 % below. A
// profile of the cold unit differs from the warm one by six times that. It needs no variance of its
// own, because a profile stays wide (0.15 to 0.20 % for the scale after 1 to 40 sweeps, by
// kSharedErrors) and a sweep's residuals outweigh it. Measured on a simulated unit that warms up by
// 0.56 %: with a profile of 12 cold sweeps three pairs of warm scans, and with one of 40 warm
// sweeps two pairs of cold scans had 30 of 30 numbers inside their intervals; with 36 cold and with
// 40 warm sweeps, Agreement() accepted nine of nine sweeps of the other kind.
CalibrationVector DriftBetweenSweeps() {
  CalibrationVector sigma;
  sigma.segment<CalibrationModel::kLensSize>(kLensAt) << 0.0001, 0.0001, 0.05, 0.05, 0.0003, 0.0006,
      0.00002, 0.00002;
  sigma[kReadoutAt] = 0.0001;
  sigma[kEdgeBiasAt] = 0.0;
  sigma.segment<kDepthField>(kDepthAt) << 0.001, 0.0005, 0.0003, 0.1, 0.1, 0.0005, 0.0003, 0.0003,
      0.0003;
  sigma.segment<kNumFieldTerms>(kDepthAt + kDepthField).setConstant(0.0001);
  sigma.segment<kNumGrowthTerms>(kDepthAt + kDepthGrowth).setConstant(0.0002);
  return sigma;
}

SensorProfile ProfileOfAnyUnit(const Intrinsics& stated, const UnitKnowledge& unit) {
  SensorProfile profile;
  profile.stated = stated;
  const CalibrationPrior prior = PriorOfAnyUnit(CalibrationModel::kEdgeBiasSigma, unit);
  profile.covariance = Inverse(prior.information, say::sensor::ProfileCovariance());
  return profile;
}

CalibrationPrior PriorOfNextSweep(const SensorProfile& profile, const Intrinsics& stated,
                                  double edge_bias_sigma_px) {
  if (profile.stated != stated) throw DataError(say::sensor::ProfileOfOtherCamera());
  CalibrationMatrix covariance = profile.covariance;
  covariance.diagonal() += DriftBetweenSweeps().cwiseAbs2();
  covariance.row(kEdgeBiasAt).setZero();
  covariance.col(kEdgeBiasAt).setZero();
  covariance(kEdgeBiasAt, kEdgeBiasAt) = edge_bias_sigma_px * edge_bias_sigma_px;
  CalibrationPrior prior;
  prior.mean = profile.mean;
  prior.mean[kEdgeBiasAt] = 0.0;
  prior.information = Inverse(covariance, say::sensor::ProfileCovariance());
  return prior;
}

SensorProfile Learn(const SensorProfile& profile, const CalibrationPrior& prior,
                    const SweepEvidence& evidence) {
  const CalibrationMatrix& lambda = prior.information;
  const double fraction = 1.0 / (kSharedErrors * kSharedErrors);
  // The solution x of a sweep whose residuals alone give y: (I + lambda) x = I y + lambda mean.
  // This is I y.
  const CalibrationVector own =
      (evidence.information + lambda) * evidence.solution - lambda * prior.mean;
  SensorProfile learned = profile;
  learned.covariance =
      Inverse(lambda + fraction * evidence.information, say::sensor::ProfileInformation());
  learned.mean = learned.covariance * (lambda * prior.mean + fraction * own);
  ++learned.num_sweeps;
  return learned;
}

}  // namespace plumb
