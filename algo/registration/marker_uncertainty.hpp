// SPDX-License-Identifier: Apache-2.0
// The uncertainty of a scene's markers, from the joint solve's own equations.
#pragma once

#include <map>

#include "algo/bundle/bundle_adjustment.hpp"
#include "algo/map/map.hpp"

namespace plumb {

/// SceneMarker::sigma_m of the markers of a solved map, metres, by id. A marker that the posterior
/// leaves undetermined has none.
///
/// The posterior is in the frame of the first keyframe. An error that all markers share there does
/// not affect the alignment of two scans, so the rigid motion that fits the errors of all corners
/// best is removed from their covariance, by a weighted fit as in an alignment. Each marker takes
/// part in that fit, which therefore absorbs part of the marker's own error; that part is added
/// back. With a single marker nothing is removed.
/// @param posterior  Of the map as it is.
[[nodiscard]] std::map<int, double> MarkerSigmas(const BundlePosterior& posterior,
                                                 const TrackingMap& map, double marker_length_m);

}  // namespace plumb
