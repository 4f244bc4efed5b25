// SPDX-License-Identifier: Apache-2.0
// Uses the method as another project would: a rigid fit, comparisons of two empty scenes and of a
// body that has moved, and a reconstructor that rejects bad input.
#include <cmath>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "algo/comparison/comparison.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "tests/support/synthetic_scene.hpp"

namespace {

/// A torso on the floor, `up_m` higher than at first.
plumb::Scene Torso(unsigned seed, double up_m) {
  plumb::test::SyntheticOptions options;
  options.seed = seed;
  options.T_reference_body = Eigen::Translation3d(0.6, 0.45, up_m);
  plumb::Scene scene = plumb::test::MakeSyntheticScene(options);
  scene.sensitivity = plumb::test::KnownCalibration(scene);
  return scene;
}

/// Whether a body that has risen by 8 mm is to be moved down by as much.
bool FindsTheCorrection() {
  const plumb::Comparison comparison = plumb::Compare(Torso(10, 0.0), Torso(17, 0.008));
  for (const std::string& reason : plumb::EnglishTexts(comparison.reasons))
    std::puts(reason.c_str());
  if (comparison.verdict != plumb::Verdict::kMove || !comparison.correction) return false;
  const plumb::CouchNumbers& numbers = comparison.correction->value;
  std::printf("vertical %.2f mm, longitudinal %.2f mm, lateral %.2f mm, yaw %.3f deg\n",
              *numbers.vertical_mm, *numbers.longitudinal_mm, *numbers.lateral_mm, numbers.yaw_deg);
  // Measured: 0.00 mm and 0.000 degrees off.
  return std::abs(*numbers.vertical_mm + 8.0) < 0.1 && std::abs(*numbers.longitudinal_mm) < 0.1 &&
         std::abs(*numbers.lateral_mm) < 0.1 && std::abs(numbers.yaw_deg) < 0.02;
}

}  // namespace

int main() {
  const std::vector<Eigen::Vector3d> b = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  const plumb::Pose T_a_b =
      Eigen::Translation3d(0.1, -0.2, 0.3) * Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 2) / 3);
  std::vector<Eigen::Vector3d> a;
  for (const Eigen::Vector3d& point : b) a.push_back(T_a_b * point);
  const plumb::RigidFit fit = plumb::FitRigid(a, b);
  if (!fit.valid || !fit.T_a_b.isApprox(T_a_b, 1e-12)) {
    std::puts("the rigid fit did not find the transform");
    return 1;
  }
  const plumb::Comparison comparison = plumb::Compare(plumb::Scene(), plumb::Scene());
  if (comparison.verdict != plumb::Verdict::kNoAnswer || comparison.reasons.empty()) {
    std::puts("two empty scenes were given an answer");
    return 1;
  }
  std::puts(comparison.reasons.front().English().c_str());
  if (!FindsTheCorrection()) {
    std::puts("the correction of a body that has moved was not found");
    return 1;
  }
  plumb::StreamInfo info;
  info.room_markers.dictionary = "NO_SUCH_DICTIONARY";
  try {
    const plumb::Reconstructor reconstructor(info, {});
    std::puts("an unknown dictionary was accepted");
    return 1;
  } catch (const std::exception& error) {
    std::puts(error.what());
  }
  return 0;
}
