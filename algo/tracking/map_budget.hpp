// SPDX-License-Identifier: Apache-2.0
// Limits the memory of a sweep of any length: a fixed number of keyframes keep their images, and a
// fixed number enter the joint solve.
#pragma once

#include <cstddef>
#include <vector>

#include "algo/map/map.hpp"
#include "algo/tracking/tracker.hpp"

namespace plumb {

/// While more than `max_images` keyframes have images, releases those of the keyframe whose
/// neighbours on the path are most alike in position and direction: depth, colour, grey levels,
/// features and marker corners. It stays in the map with its pose and keypoints. Only the poses
/// decide, so the same frames give the same bits.
///
/// The first keyframe and the newest kNewestKept keyframes always keep their images.
void BoundImages(std::size_t max_images, TrackingMap& map);
inline constexpr std::size_t kNewestKept = 12;

/// While the map has more than `max_keyframes`, turns one without images into an ordinary tracked
/// frame, chosen as by BoundImages(): its observations leave the map, and its pose and those of the
/// frames tracked against it follow from the keyframe against which it was tracked itself. The
/// joint solve needs memory for each observation and for the square of the number of keyframes.
///
/// @param path  The frames' present colour poses in the map's world, which stay the same.
/// @param frames  All frames of the map; the indices of keyframes in frames and map are updated.
void BoundKeyframes(std::size_t max_keyframes, const std::vector<Pose>& path,
                    std::vector<TrackedFrame>& frames, TrackingMap& map);

}  // namespace plumb
