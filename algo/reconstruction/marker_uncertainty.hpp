// The uncertainty of a scene's markers, from the joint solve's own equations.
#pragma once

#include <map>

#include "algo/tracking/bundle_adjustment.hpp"
#include "algo/tracking/map.hpp"

namespace plumb {

/// SceneMarker::sigma_m of the markers of a solved map, metres, by id. A marker that the posterior
/// leaves undetermined has none.
///
/// The posterior is in the frame of the first keyframe, and what all markers share there (its
/// error and that of the path from it) leaves any two scans' alignment unchanged. So the rigid
/// motion that fits the errors of all corners best is taken out of their covariance, in a weighted
/// fit as an alignment makes it. A marker takes part in that fit and hides a part of its own error
/// from it, which is added again. Of a single marker nothing is taken out.
/// @param posterior  Of the map as it is.
[[nodiscard]] std::map<int, double> MarkerSigmas(const BundlePosterior& posterior,
                                                 const TrackingMap& map, double marker_length_m);

}  // namespace plumb
