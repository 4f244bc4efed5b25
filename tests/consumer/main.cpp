// Uses the method as another project would: a rigid fit, a comparison of two empty scenes, and a
// reconstructor that rejects bad input.
#include <cstdio>
#include <exception>
#include <vector>

#include <Eigen/Geometry>

#include "algo/comparison/comparison.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "algo/reconstruction/reconstructor.hpp"

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
  std::puts(comparison.reasons.front().c_str());
  plumb::StreamInfo info;
  info.marker_dictionary = "NO_SUCH_DICTIONARY";
  try {
    const plumb::Reconstructor reconstructor(info, {});
    std::puts("an unknown dictionary was accepted");
    return 1;
  } catch (const std::exception& error) {
    std::puts(error.what());
  }
  return 0;
}
