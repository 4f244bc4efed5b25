// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/surface_mesh.hpp"

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace plumb {
namespace {

HeightMap Tilted(int width, int height, float slope_x) {
  HeightMap map(
      GridShape{.x_min = -0.1, .y_min = 0.2, .step = 0.01, .width = width, .height = height});
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column)
      map.z[static_cast<std::size_t>(row * width + column)] =
          1.0F + slope_x * 0.01F * static_cast<float>(column);
  return map;
}

TEST(SurfaceMeshTest, AFullMapBecomesTwoTrianglesASquareFacingUp) {
  const HeightMap map = Tilted(5, 4, 0.5F);
  const TriangleMesh mesh = MeshOfHeightMap(map);
  EXPECT_EQ(mesh.vertices.size(), 20U);
  EXPECT_EQ(mesh.triangles.size(), 2U * 4U * 3U);
  EXPECT_TRUE(mesh.colors.empty());
  const Eigen::Vector3f normal = Eigen::Vector3f(-0.5F, 0, 1).normalized();
  double area = 0.0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f cross = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                                      .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    EXPECT_GT(cross.z(), 0.0F);
    area += 0.5 * cross.norm();
  }
  EXPECT_NEAR(area, 0.04 * 0.03 * std::sqrt(1.25), 1e-7);
  for (const Eigen::Vector3f& n : mesh.normals) EXPECT_TRUE(n.isApprox(normal, 1e-4F));
  EXPECT_NEAR(mesh.vertices[0].x(), -0.095F, 1e-6F);
  EXPECT_NEAR(mesh.vertices[0].y(), 0.205F, 1e-6F);
}

TEST(SurfaceMeshTest, HolesAndStepsStayOpen) {
  HeightMap map = Tilted(6, 3, 0.0F);
  for (int row = 0; row < 3; ++row)
    for (int column = 3; column < 6; ++column)
      map.z[static_cast<std::size_t>(row * 6 + column)] += 0.5F;  // a step of half a metre
  map.z[0] = std::numeric_limits<float>::quiet_NaN();
  const TriangleMesh mesh = MeshOfHeightMap(map);
  // Each side has 2 x 2 squares = 8 triangles; the missing corner costs one and its vertex.
  EXPECT_EQ(mesh.triangles.size(), 15U);
  EXPECT_EQ(mesh.vertices.size(), 17U);
  for (const auto& t : mesh.triangles)
    EXPECT_LT(std::abs(mesh.vertices[t[0]].z() - mesh.vertices[t[1]].z()) +
                  std::abs(mesh.vertices[t[0]].z() - mesh.vertices[t[2]].z()),
              0.1F);
}

TEST(SurfaceMeshTest, DecimationTakesEveryNthCellWithItsColour) {
  const HeightMap map = Tilted(9, 7, 0.0F);
  std::vector<Color> colors(map.grid.num_cells());
  for (std::size_t i = 0; i < colors.size(); ++i) colors[i] = {static_cast<std::uint8_t>(i), 0, 0};
  const TriangleMesh mesh = MeshOfHeightMap(map, colors, {.decimation = 3});
  EXPECT_EQ(mesh.vertices.size(), 9U);
  EXPECT_EQ(mesh.triangles.size(), 8U);
  std::set<int> reds;
  for (const Color& color : mesh.colors) reds.insert(color[0]);
  EXPECT_EQ(reds, (std::set<int>{0, 3, 6, 27, 30, 33, 54, 57, 60}));
}

TEST(SurfaceMeshTest, EmptyMapsGiveEmptyMeshesAndMistakesAreNamed) {
  EXPECT_TRUE(MeshOfHeightMap(HeightMap{}).triangles.empty());
  EXPECT_TRUE(MeshOfHeightMap(HeightMap(GridShape{.width = 4, .height = 4})).vertices.empty());
  EXPECT_THROW((void)MeshOfHeightMap(HeightMap{}, {}, {.decimation = 0}), std::invalid_argument);
  EXPECT_THROW((void)MeshOfHeightMap(Tilted(3, 3, 0), std::vector<Color>(8)),
               std::invalid_argument);
}

TEST(ColorsFromCloudTest, ACellTakesItsOwnPointNearestInHeightElseItsNeighbours) {
  HeightMap map = Tilted(4, 1, 0.0F);
  map.z[3] = std::numeric_limits<float>::quiet_NaN();
  PointCloud cloud;
  cloud.points = {{-0.095F, 0.205F, 0.2F}, {-0.095F, 0.205F, 0.99F}};
  cloud.colors = {{1, 1, 1}, {2, 2, 2}};
  const std::vector<Color> colors = ColorsFromCloud(map, cloud);
  ASSERT_EQ(colors.size(), 4U);
  EXPECT_EQ(colors[0], (Color{2, 2, 2}));
  EXPECT_EQ(colors[2], (Color{2, 2, 2}));
  EXPECT_EQ(colors[3], (Color{0, 0, 0}));
  cloud.colors.clear();
  EXPECT_TRUE(ColorsFromCloud(map, cloud).empty());
}

TEST(ColorsFromCloudTest, AMeshOfEverySecondCellHasTheColoursOfAllCells) {
  const HeightMap map = Tilted(5, 7, 0.3F);
  PointCloud cloud;
  for (int row = 0; row < map.grid.height; ++row) {
    for (int column = 0; column < map.grid.width; column += 3) {
      cloud.points.emplace_back(static_cast<float>(map.grid.x_centre(column)),
                                static_cast<float>(map.grid.y_centre(row)), map.at(row, column));
      cloud.colors.push_back(
          {static_cast<std::uint8_t>(10 * row + 1), static_cast<std::uint8_t>(10 * column + 1), 7});
    }
  }
  const SurfaceMeshOptions options{.decimation = 2};
  const TriangleMesh all = MeshOfHeightMap(map, ColorsFromCloud(map, cloud), options);
  const TriangleMesh some = MeshOfHeightMap(map, ColorsFromCloud(map, cloud, 2), options);
  ASSERT_FALSE(all.colors.empty());
  EXPECT_EQ(some.colors, all.colors);
  EXPECT_NE(ColorsFromCloud(map, cloud, 2), ColorsFromCloud(map, cloud))
      << "cells between are left out";
  EXPECT_THROW((void)ColorsFromCloud(map, cloud, 0), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
