// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/ply_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>

#include "algo/base/errors.hpp"
#include "daemon/mesh_formats/mesh_file.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageOf;
using testing::TempFolder;

using Bytes = std::vector<std::uint8_t>;

PointCloud ThreePoints() {
  PointCloud cloud;
  cloud.points = {{0, 0, 0.5F}, {1.25F, -2, 3}, {-1e-6F, 7, 8}};
  cloud.normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
  cloud.colors = {Color{1, 2, 3}, Color{255, 0, 128}, Color{9, 8, 7}};
  return cloud;
}

TriangleMesh Tetrahedron() {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.colors = {Color{1, 2, 3}, Color{4, 5, 6}, Color{7, 8, 9}, Color{10, 11, 12}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  return mesh;
}

Bytes Ascii(std::string_view text) { return {text.begin(), text.end()}; }

template <typename T>
void Append(Bytes& bytes, T value) {
  const auto* begin = reinterpret_cast<const std::uint8_t*>(&value);
  bytes.insert(bytes.end(), begin, begin + sizeof value);
}

TEST(PlyFileTest, CloudKeepsEveryBit) {
  const TempFolder folder;
  WriteCloudPly(folder / "c.ply", ThreePoints());
  const PointCloud cloud = ReadCloudPly(folder / "c.ply");
  EXPECT_EQ(cloud.points, ThreePoints().points);
  EXPECT_EQ(cloud.normals, ThreePoints().normals);
  EXPECT_EQ(cloud.colors, ThreePoints().colors);
}

TEST(PlyFileTest, AttributesThatAreLeftOutStayOut) {
  const TempFolder folder;
  PointCloud cloud = ThreePoints();
  cloud.colors.clear();
  WriteCloudPly(folder / "c.ply", cloud);
  EXPECT_TRUE(ReadCloudPly(folder / "c.ply").colors.empty());
  EXPECT_EQ(ReadCloudPly(folder / "c.ply").normals, cloud.normals);
  WriteCloudPly(folder / "empty.ply", PointCloud{});
  EXPECT_TRUE(ReadCloudPly(folder / "empty.ply").empty());
}

TEST(PlyFileTest, MeshKeepsEveryBit) {
  const TempFolder folder;
  WriteMeshPly(folder / "m.ply", Tetrahedron());
  const TriangleMesh mesh = ReadMeshPly(folder / "m.ply");
  EXPECT_EQ(mesh.vertices, Tetrahedron().vertices);
  EXPECT_EQ(mesh.colors, Tetrahedron().colors);
  EXPECT_EQ(mesh.triangles, Tetrahedron().triangles);
}

// The bytes by hand, after the format's definition.
TEST(PlyFileTest, WritesTheBytesOfTheFormat) {
  const TempFolder folder;
  TriangleMesh mesh;
  mesh.vertices = {{1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  mesh.triangles = {{0, 1, 2}};
  WriteMeshPly(folder / "m.ply", mesh);
  Bytes expected = Ascii(
      "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex 3\nproperty float "
      "x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n");
  for (const float value : {1.F, 0.F, 0.F, 0.F, 2.F, 0.F, 0.F, 0.F, 3.F}) Append(expected, value);
  Append(expected, std::uint8_t{3});
  for (const std::int32_t index : {0, 1, 2}) Append(expected, index);
  EXPECT_EQ(ReadWholeFile(folder / "m.ply", 10000), expected);
}

TEST(PlyFileTest, ReadsOtherLayouts) {
  Bytes bytes = Ascii(
      "ply\nformat binary_little_endian 1.0\nobj_info x\nelement vertex 1\nproperty uchar "
      "red\nproperty uchar green\nproperty uchar blue\n"
      "property double z\nproperty double y\nproperty double x\nproperty float "
      "quality\nend_header\n");
  for (const int color : {10, 20, 30}) Append(bytes, static_cast<std::uint8_t>(color));
  for (const double value : {3.0, 2.0, 1.0}) Append(bytes, value);
  Append(bytes, 0.5F);
  const PointCloud cloud = ParseCloudPly(bytes, "other");
  EXPECT_THAT(cloud.points, ElementsAre(Eigen::Vector3f(1, 2, 3)));
  EXPECT_THAT(cloud.colors, ElementsAre(Color{10, 20, 30}));
}

TEST(PlyFileTest, ColoursThatAreNoNumbersAreRefused) {
  Bytes bytes = Ascii(
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float "
      "y\nproperty float z\n"
      "property float red\nproperty float green\nproperty float blue\nend_header\n");
  for (int i = 0; i < 5; ++i) Append(bytes, 1.0F);
  Append(bytes, std::numeric_limits<float>::quiet_NaN());
  EXPECT_THAT(MessageOf<DataError>([&] { (void)ParseCloudPly(bytes, "c.ply"); }),
              HasSubstr("colour of vertex 0"));
}

TEST(PlyFileTest, EveryTruncationIsAnError) {
  const TempFolder folder;
  WriteMeshPly(folder / "m.ply", Tetrahedron());
  const Bytes bytes = ReadWholeFile(folder / "m.ply", 10000);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW((void)ParseMeshPly(std::span(bytes).first(size), "cut"), DataError)
        << size << " of " << bytes.size();
  }
  EXPECT_THAT(MessageOf<DataError>([&] {
                (void)ParseMeshPly(std::span(bytes).first(bytes.size() - 1), "mesh.ply");
              }),
              AllOf(HasSubstr("mesh.ply"), HasSubstr("truncated"), HasSubstr("expected 112")));
}

TEST(PlyFileTest, DamageIsNamed) {
  const auto refusal = [](const std::string& header, const Bytes& body = {}) {
    Bytes bytes = Ascii(header);
    bytes.insert(bytes.end(), body.begin(), body.end());
    return MessageOf<DataError>([&] { (void)ParseMeshPly(bytes, "m.ply"); });
  };
  const std::string start = "ply\nformat binary_little_endian 1.0\n";
  const std::string vertex =
      "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
  EXPECT_THAT(refusal("hello"), HasSubstr("no PLY header"));
  EXPECT_THAT(refusal("ply\nformat ascii 1.0\n" + vertex + "end_header\n"),
              HasSubstr("format is ascii"));
  EXPECT_THAT(refusal(start + "end_header\n"), HasSubstr("vertex"));
  EXPECT_THAT(refusal(start + "element vertex 99999999999\nproperty float x\nend_header\n"),
              HasSubstr("count"));
  EXPECT_THAT(refusal(start + "element vertex -1\nproperty float x\nend_header\n"),
              HasSubstr("count"));
  EXPECT_THAT(refusal(start + "element vertex 90000000\nproperty double x\nend_header\n"),
              HasSubstr("truncated"));
  EXPECT_THAT(refusal(start + "element vertex 1\nproperty quad x\nend_header\n"),
              HasSubstr("quad"));
  EXPECT_THAT(refusal(start + "element vertex 0\nproperty float x\nend_header\n"),
              HasSubstr("no x, y, z"));
  EXPECT_THAT(refusal(start + vertex + "banana\nend_header\n"), HasSubstr("banana"));

  Bytes nan;
  for (int i = 0; i < 3; ++i) Append(nan, std::numeric_limits<float>::quiet_NaN());
  EXPECT_THAT(refusal(start + vertex + "end_header\n", nan), HasSubstr("vertex 0 is not finite"));

  Bytes outside(12, 0);
  outside.push_back(3);
  for (const std::int32_t index : {0, 0, 1}) Append(outside, index);
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_THAT(refusal(start + vertex + face, outside), HasSubstr("face 0 names vertex 1"));
  outside[12] = 4;
  EXPECT_THAT(refusal(start + vertex + face, outside), HasSubstr("4 corners"));
}

TEST(PlyFileTest, ContradictionsAreTheCallersMistake) {
  const TempFolder folder;
  PointCloud cloud = ThreePoints();
  cloud.normals.pop_back();
  EXPECT_THROW(WriteCloudPly(folder / "c.ply", cloud), std::invalid_argument);
  TriangleMesh mesh = Tetrahedron();
  mesh.triangles[1][2] = 4;
  EXPECT_THROW(WriteMeshPly(folder / "m.ply", mesh), std::invalid_argument);
  EXPECT_THROW(WriteMeshStl(folder / "m.stl", mesh, MeshUnit::kMetres), std::invalid_argument);
}

TEST(MeshFileTest, StlHoldsTheTrianglesWithOutwardNormals) {
  const TempFolder folder;
  EXPECT_EQ(UsualUnit("m.STL"), MeshUnit::kMillimetres);
  WriteMeshFile(folder / "m.STL", Tetrahedron(), MeshUnit::kMillimetres);
  const Bytes bytes = ReadWholeFile(folder / "m.STL", 10000);
  ASSERT_EQ(bytes.size(), 84U + 4 * 50);
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  EXPECT_EQ(count, 4U);
  float first[12];
  std::memcpy(first, bytes.data() + 84, sizeof first);
  EXPECT_THAT(
      first, ElementsAre(0, 0, -1, 0, 0, 0, 0, 1000, 0, 1000, 0, 0));  // the bottom face looks down
  EXPECT_THAT(std::string(bytes.begin(), bytes.begin() + 80), HasSubstr("in millimetres"));
  EXPECT_NE(std::string(bytes.begin(), bytes.begin() + 5), "solid");
}

TEST(MeshFileTest, ObjCountsFromOne) {
  const TempFolder folder;
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1.5F, 0}};
  mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  mesh.colors = {Color{255, 0, 0}, Color{0, 255, 0}, Color{0, 0, 255}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(UsualUnit("m.obj"), MeshUnit::kMetres);
  WriteMeshFile(folder / "m.obj", mesh, MeshUnit::kMetres);
  EXPECT_THAT(ReadTextFile(folder / "m.obj", 10000),
              AllOf(HasSubstr("v 0.000000 1.500000 0.000000 0.0000 0.0000 1.0000\n"),
                    HasSubstr("vn 0.00000 0.00000 1.00000\n"), HasSubstr("f 1//1 2//2 3//3\n")));
}

TEST(MeshFileTest, OtherEndingsAreTheCallersMistake) {
  const TempFolder folder;
  EXPECT_THAT(MessageOf<std::invalid_argument>(
                  [&] { WriteMeshFile(folder / "m.gltf", Tetrahedron(), MeshUnit::kMetres); }),
              HasSubstr(".ply, .stl or .obj"));
}

}  // namespace
}  // namespace plumb
