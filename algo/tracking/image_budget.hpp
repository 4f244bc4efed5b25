// Bounds the memory of a sweep of any length: only so many keyframes keep their images.
#pragma once

#include <cstddef>

#include "algo/tracking/map.hpp"

namespace plumb {

/// While more than `max_images` keyframes have images, the one whose neighbours on the way are most
/// alike in place and direction loses what only images give: depth, colour, grey, features and
/// marker corners. It stays in the map with its pose and keypoints. The poses alone decide, so the
/// same frames give the same bits.
///
/// The first keyframe and the newest kNewestKept are never chosen.
void BoundImages(std::size_t max_images, TrackingMap& map);
inline constexpr std::size_t kNewestKept = 12;

}  // namespace plumb
