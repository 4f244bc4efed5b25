// Limits the memory of a sweep of any length: only a fixed number of keyframes keep their images.
#pragma once

#include <cstddef>

#include "algo/tracking/map.hpp"

namespace plumb {

/// While more than `max_images` keyframes have images, releases those of the keyframe whose
/// neighbours on the path are most alike in position and direction: depth, colour, grey levels,
/// features and marker corners. It stays in the map with its pose and keypoints. Only the poses
/// decide, so the same frames give the same bits.
///
/// The first keyframe and the newest kNewestKept keyframes always keep their images.
void BoundImages(std::size_t max_images, TrackingMap& map);
inline constexpr std::size_t kNewestKept = 12;

}  // namespace plumb
