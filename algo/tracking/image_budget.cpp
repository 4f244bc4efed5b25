#include "algo/tracking/image_budget.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace plumb {
namespace {

// Dissimilarity of two views: distance as a fraction of the depth, plus radians.
double Apart(const MapKeyframe& a, const MapKeyframe& b) {
  const double depth = std::clamp(a.median_depth_m, 0.4, 3.0);
  const Pose T = a.T_world_color.inverse() * b.T_world_color;
  return T.translation().norm() / depth + RotationAngle(T);
}

// The keyframe whose images may be released and whose neighbours before and after are most alike,
// so that the path stays covered without it. 0: there is none.
std::size_t LeastMissed(const TrackingMap& map, const std::vector<std::size_t>& with_images) {
  std::size_t chosen = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i + 1 < with_images.size(); ++i) {
    const std::size_t k = with_images[i];
    if (k + kNewestKept >= map.keyframes.size()) break;
    const double apart =
        Apart(map.keyframes[with_images[i - 1]], map.keyframes[with_images[i + 1]]);
    if (apart >= least) continue;
    least = apart;
    chosen = k;
  }
  return chosen;
}

void ReleaseImages(MapKeyframe& keyframe) {
  keyframe.is_bare = true;
  keyframe.data.view.depth_m.release();
  keyframe.data.view.color_rgb.release();
  keyframe.gray.release();
  keyframe.descriptors.release();
  keyframe.features_px = {};
  keyframe.features_camera = {};
  keyframe.dense = {};
  // Corners are measured again in the images once the tone curve is known. Corners that cannot be
  // measured again would contradict the others.
  keyframe.data.markers = {};
}

}  // namespace

void BoundImages(std::size_t max_images, TrackingMap& map) {
  std::vector<std::size_t> with_images;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (!map.keyframes[k].is_bare) with_images.push_back(k);
  while (with_images.size() > max_images) {
    const std::size_t k = LeastMissed(map, with_images);
    if (k == 0) return;  // All others are needed.
    ReleaseImages(map.keyframes[k]);
    std::erase(with_images, k);
  }
}

}  // namespace plumb
