// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/planned_scenes.hpp"

#include <utility>

#include "algo/base/units.hpp"

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;

Vector3d AreaCentroid(const TriangleMesh& mesh) {
  Vector3d weighted = Vector3d::Zero();
  double total = 0;
  for (const auto& triangle : mesh.triangles) {
    const Vector3d a = mesh.vertices[triangle[0]].cast<double>();
    const Vector3d b = mesh.vertices[triangle[1]].cast<double>();
    const Vector3d c = mesh.vertices[triangle[2]].cast<double>();
    const double area = 0.5 * (b - a).cross(c - a).norm();
    weighted += area * (a + b + c) / 3.0;
    total += area;
  }
  return weighted / total;
}

}  // namespace

std::shared_ptr<const DistanceGrid> MakeGrid(const BodyShape& shape) {
  constexpr double kSpacing = 5 * kMillimetre;
  return std::make_shared<const DistanceGrid>(
      [&](const Vector3d& p) { return BodyImplicit(shape, p); }, BodyBox(shape), kSpacing);
}

std::shared_ptr<const BodyModel> MakeBody(const BodyShape& shape) {
  BodyModel body;
  body.shape = shape;
  body.grid = MakeGrid(shape);
  body.surface = body.grid->Surface();
  body.centroid = AreaCentroid(body.surface);
  return std::make_shared<const BodyModel>(std::move(body));
}

}  // namespace plumb::simulated
