// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/breathing_check.hpp"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "algo/registration/depth_views.hpp"

namespace plumb {

void MovePatches(const Intrinsics& stated, const SweepSolution& from, const SweepSolution& to,
                 std::span<SurfacePatch> patches) {
  const Intrinsics camera_from = dense::MakeSensor(stated, from.calibration).depth;
  const Intrinsics camera_to = dense::MakeSensor(stated, to.calibration).depth;
  std::vector<Pose> T_depth_scene;
  for (const Pose& T_scene_depth : from.T_scene_depth)
    T_depth_scene.push_back(T_scene_depth.inverse());
  tbb::parallel_for(std::size_t{0}, patches.size(), [&](std::size_t p) {
    SurfacePatch& patch = patches[p];
    const Eigen::Vector3d centre = patch.centre_m.cast<double>();
    for (PatchSample& sample : patch.samples) {
      const Eigen::Vector3d in_view = T_depth_scene[sample.view] * centre;
      const Eigen::Vector2d pixel = Project(camera_from, in_view);
      const Eigen::Vector2d centred =
          CentredCoordinates(pixel.x(), pixel.y(), stated.width, stated.height);
      double raw_m = in_view.z();
      for (int step = 0; step < 2; ++step)  // The correction is small and smooth.
        raw_m += in_view.z() - from.calibration.CorrectedDepth(raw_m, centred);
      const double z_m = to.calibration.CorrectedDepth(raw_m, centred);
      const Eigen::Vector2d ray = Undistort(camera_to, pixel);
      const Eigen::Vector3d moved =
          to.T_scene_depth[sample.view] * Eigen::Vector3d(ray.x() * z_m, ray.y() * z_m, z_m);
      sample.distance_m += static_cast<float>(patch.normal.cast<double>().dot(moved - centre));
    }
  });
}

Breathing CheckedBreathing(const Breathing& found, const Breathing& on_body,
                           const Breathing& without_dense) {
  if (!(found.amplitude_m > 0)) return found;
  const bool contradicted =
      !(without_dense.amplitude_m > 0) && without_dense.limit_m < on_body.amplitude_m;
  if (on_body.amplitude_m > 0 && !contradicted) return on_body;
  // There was a rise of this size, but it was not shown to be that of a body.
  return {.limit_m = std::max(found.limit_m, found.amplitude_m)};
}

}  // namespace plumb
