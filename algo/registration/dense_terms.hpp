// SPDX-License-Identifier: Apache-2.0
// Constraints on the poses and the sensor's calibration from overlapping depth images and markers'
// faces: the dense part of RegisterJointly().
#pragma once

#include <stop_token>
#include <vector>

#include "algo/bundle/bundle_adjustment.hpp"
#include "algo/registration/depth_views.hpp"
#include "algo/registration/registration_options.hpp"

namespace plumb::dense {

struct KeyframePair {
  int a = 0;  ///< View whose cells are projected.
  int b = 0;  ///< View into which they are projected.
  double overlap = 0;
};

/// Pairs of views that overlap enough, at most JointRegistrationOptions::max_pairs for each view.
/// @throws Interrupted on a stop request
std::vector<KeyframePair> FindPairs(const Sensor& sensor, const JointRegistrationOptions& options,
                                    const std::vector<View>& views, const std::stop_token& stop);

/// How many of the cells are used. Coarse: a quarter of those of fine, each with four times the
/// weight; for the early rounds, whose terms only provide a start for the fine ones.
enum class Density { kCoarse, kFine };

/// Point-to-plane residuals of each pair, and of the depth on each marker's face, linearised.
/// @param gate_m  Larger residuals are not correspondences.
/// Where images have errors of their own, the terms are as uncertain as these leave them.
/// @param errors  With which the views were made.
/// @param terms  Replaced; its memory is used again.
/// @throws Interrupted on a stop request
void MakeTerms(const Sensor& sensor, const JointRegistrationOptions& options,
               const TrackingMap& map, const std::vector<View>& views,
               const std::vector<KeyframePair>& pairs, double gate_m, Density density,
               const DepthErrors& errors, const std::stop_token& stop,
               std::vector<QuadraticTerm>& terms);

/// The errors of the views' depth images, from overlapping views and markers' faces where the poses
/// are, and from the prior of the options. None if that says that there are none.
/// @param views  Made without errors.
[[nodiscard]] DepthErrors FindDepthErrors(const Sensor& sensor,
                                          const JointRegistrationOptions& options,
                                          const TrackingMap& map, const std::vector<View>& views,
                                          const std::vector<KeyframePair>& pairs, double gate_m,
                                          const std::stop_token& stop);

/// Covariance of the errors that FindDepthErrors() finds with the calibration, as they follow the
/// poses, the markers and the calibration of the posterior.
/// @param map  As the posterior states it; the views are of that state.
[[nodiscard]] DepthErrorColumns FindDepthErrorColumns(
    const Sensor& sensor, const JointRegistrationOptions& options, const TrackingMap& map,
    const std::vector<View>& views, const std::vector<KeyframePair>& pairs, double gate_m,
    const BundlePosterior& posterior, const std::stop_token& stop);

/// Median absolute point-to-plane distance of the cells that MakeTerms() never uses, metres; 0
/// without any.
double Consistency(const Sensor& sensor, const std::vector<View>& views,
                   const std::vector<KeyframePair>& pairs, double gate_m);

/// Whether held-out cells agree as well as before, up to a difference that says nothing.
[[nodiscard]] bool AsConsistent(double before_m, double after_m);

}  // namespace plumb::dense
