// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/map_budget.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "algo/tracking/view_geometry.hpp"

namespace plumb {
namespace {

// The keyframe of `path` that may be given up and whose neighbours before and after are most alike,
// so that the path stays covered without it. 0: there is none.
template <class MayGo>
std::size_t LeastMissed(const TrackingMap& map, const std::vector<std::size_t>& path,
                        const MayGo& may_go) {
  std::size_t chosen = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i + 1 < path.size(); ++i) {
    const std::size_t k = path[i];
    if (!may_go(k, path[i - 1])) continue;
    const double apart =
        ViewDistance(map.keyframes[path[i - 1]], map.keyframes[path[i + 1]].T_world_color);
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

// Links the keyframes that were tracked against `gone` to the one against which it was tracked.
void LinkToPrevious(std::size_t gone, TrackingMap& map) {
  const MapKeyframe& keyframe = map.keyframes[gone];
  const int previous = keyframe.previous.value();
  const Pose T_previous_gone =
      map.keyframe(previous).T_world_color.inverse() * keyframe.T_world_color;
  for (MapKeyframe& other : map.keyframes) {
    if (other.previous != static_cast<int>(gone)) continue;
    other.previous = previous;
    other.T_previous_color = T_previous_gone * other.T_previous_color;
  }
}

// Lets the frames refer to kept keyframes only, from where they are on the path. The poses at which
// they were tracked are not enough: keyframes were adjusted since, and the differences were spread
// over sections of the path, some of which end.
void ReferToKept(const std::vector<bool>& is_kept, const std::vector<Pose>& path,
                 const TrackingMap& map, std::vector<TrackedFrame>& frames) {
  const auto pose = [&](int keyframe) { return map.keyframe(keyframe).T_world_color; };
  const auto refer = [&](std::optional<int>& keyframe) {
    if (keyframe && !is_kept[static_cast<std::size_t>(*keyframe)])
      keyframe = map.keyframe(*keyframe).previous;
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    TrackedFrame& frame = frames[i];
    if (frame.keyframe && !is_kept[static_cast<std::size_t>(*frame.keyframe)]) {
      frame.keyframe.reset();
      frame.previous_keyframe.reset();
    }
    refer(frame.reference_keyframe);
    refer(frame.previous_keyframe);
    if (!frame.tracked) continue;
    if (!frame.keyframe) {
      frame.T_reference_color = pose(frame.reference_keyframe.value()).inverse() * path[i];
    } else if (frame.previous_keyframe) {
      frame.T_previous_color = pose(*frame.previous_keyframe).inverse() * pose(*frame.keyframe);
    }
  }
}

// Removes all other keyframes from the map.
void RemoveOthers(const std::vector<bool>& is_kept, std::vector<TrackedFrame>& frames,
                  TrackingMap& map) {
  std::vector<std::optional<int>> new_index(map.keyframes.size());
  std::vector<MapKeyframe> kept;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    if (is_kept[k]) {
      new_index[k] = static_cast<int>(kept.size());
      kept.push_back(std::move(map.keyframes[k]));
      continue;
    }
    for (const KeypointObservation& o : map.keyframes[k].keypoints)
      --map.landmark(o.landmark).num_observations;
  }
  map.keyframes = std::move(kept);
  const auto renumber = [&](std::optional<int>& keyframe) {
    if (keyframe) keyframe = new_index[static_cast<std::size_t>(*keyframe)];
  };
  for (MapKeyframe& keyframe : map.keyframes) renumber(keyframe.previous);
  for (TrackedFrame& frame : frames) {
    renumber(frame.keyframe);
    renumber(frame.reference_keyframe);
    renumber(frame.previous_keyframe);
  }
  // Only loop closure, which has ended, uses the keyframe that first saw a landmark.
  for (Landmark& landmark : map.landmarks)
    landmark.first_keyframe =
        new_index[static_cast<std::size_t>(landmark.first_keyframe)].value_or(0);
}

}  // namespace

void BoundImages(std::size_t max_images, TrackingMap& map) {
  std::vector<std::size_t> with_images;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k)
    if (!map.keyframes[k].is_bare) with_images.push_back(k);
  const auto may_go = [&](std::size_t k, std::size_t) {
    return k + kNewestKept < map.keyframes.size();
  };
  while (with_images.size() > max_images) {
    const std::size_t k = LeastMissed(map, with_images, may_go);
    if (k == 0) return;  // All others are needed.
    ReleaseImages(map.keyframes[k]);
    std::erase(with_images, k);
  }
}

void BoundKeyframes(std::size_t max_keyframes, const std::vector<Pose>& path,
                    std::vector<TrackedFrame>& frames, TrackingMap& map) {
  if (map.keyframes.size() <= max_keyframes) return;
  std::vector<std::size_t> kept(map.keyframes.size());
  std::iota(kept.begin(), kept.end(), std::size_t{0});
  // A keyframe that was tracked against another one than that before it begins a new section.
  const auto may_go = [&](std::size_t k, std::size_t before) {
    return map.keyframes[k].is_bare && map.keyframes[k].previous == static_cast<int>(before);
  };
  std::vector<bool> is_kept(kept.size(), true);
  while (kept.size() > max_keyframes) {
    const std::size_t k = LeastMissed(map, kept, may_go);
    if (k == 0) break;  // All others are needed.
    LinkToPrevious(k, map);
    is_kept[k] = false;
    std::erase(kept, k);
  }
  ReferToKept(is_kept, path, map, frames);
  RemoveOthers(is_kept, frames, map);
}

}  // namespace plumb
