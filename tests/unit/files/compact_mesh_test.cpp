// SPDX-License-Identifier: Apache-2.0
// Packed surfaces read back as the surfaces they were made of.
#include "daemon/files/compact_map.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/files/ply_file.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// As a browser reads it, written from the description in the header.
TriangleMesh Unpacked(const std::string& bytes, float& step) {
  EXPECT_EQ(bytes.substr(0, 4), "PLM2");
  std::array<std::uint32_t, 2> sizes{};
  std::array<float, 4> numbers{};
  std::memcpy(sizes.data(), bytes.data() + 4, sizeof sizes);
  std::memcpy(numbers.data(), bytes.data() + 12, sizeof numbers);
  step = numbers[3];
  std::vector<unsigned char> content(6 * std::size_t{sizes[0]} + 15 * std::size_t{sizes[1]} + 1);
  uLongf size = content.size();
  EXPECT_EQ(uncompress(content.data(), &size, reinterpret_cast<const Bytef*>(bytes.data() + 28),
                       bytes.size() - 28),
            Z_OK);
  TriangleMesh mesh;
  mesh.vertices.resize(sizes[0]);
  std::size_t at = 0;
  for (int axis = 0; axis < 3; ++axis) {
    std::uint16_t steps = 0;
    for (Eigen::Vector3f& vertex : mesh.vertices) {
      steps = static_cast<std::uint16_t>(steps + (content[at] | content[at + 1] << 8));
      vertex[axis] = numbers[static_cast<std::size_t>(axis)] + static_cast<float>(steps) * step;
      at += 2;
    }
  }
  std::int64_t corner = 0;
  mesh.triangles.resize(sizes[1]);
  for (auto& triangle : mesh.triangles) {
    for (std::uint32_t& one : triangle) {
      std::uint64_t zigzag = 0;
      for (unsigned shift = 0;; shift += 7) {
        const std::uint64_t group = content[at++];
        zigzag |= (group & 0x7FU) << shift;
        if ((group & 0x80U) == 0) break;
      }
      corner += (zigzag & 1U) != 0 ? -static_cast<std::int64_t>(zigzag / 2) - 1
                                   : static_cast<std::int64_t>(zigzag / 2);
      one = static_cast<std::uint32_t>(corner);
    }
  }
  EXPECT_EQ(at, size);
  return mesh;
}

/// A wavy sheet of 2 m with a vertex every centimetre.
TriangleMesh Sheet() {
  constexpr std::uint32_t kSide = 200;
  TriangleMesh mesh;
  for (std::uint32_t row = 0; row < kSide; ++row) {
    for (std::uint32_t column = 0; column < kSide; ++column) {
      const Eigen::Vector3f p(0.01F * static_cast<float>(column) - 0.7F,
                              0.01F * static_cast<float>(row) - 1.3F,
                              0.1F * std::sin(0.05F * static_cast<float>(row + column)));
      mesh.vertices.push_back(p);
      mesh.normals.emplace_back(0, 0, 1);
      if (row == 0 || column == 0) continue;
      const std::uint32_t i = row * kSide + column;
      mesh.triangles.push_back({i, i - 1, i - kSide});
      mesh.triangles.push_back({i - 1, i - kSide - 1, i - kSide});
    }
  }
  return mesh;
}

TEST(CompactMesh, KeepsEveryTriangleAndTheVerticesToHalfAStep) {
  const TriangleMesh mesh = Sheet();
  float step = 0;
  const TriangleMesh read = Unpacked(CompactMesh(mesh), step);
  EXPECT_LT(step, 31e-6F) << "2 m in 65535 steps";
  EXPECT_EQ(read.triangles, mesh.triangles);
  ASSERT_EQ(read.vertices.size(), mesh.vertices.size());
  float worst = 0;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i)
    worst = std::max(worst, (read.vertices[i] - mesh.vertices[i]).cwiseAbs().maxCoeff());
  EXPECT_LT(worst, 0.51F * step + 1e-6F) << "1e-6: of the 32-bit numbers";
}

TEST(CompactMesh, IsAFractionOfThePlyFile) {
  const testing::TempFolder folder;
  fs::create_directories(folder / "scene");
  WriteMeshPly(folder / "scene/mesh.ply", Sheet());
  const std::string packed = CompactMap(folder / "", "mesh");
  EXPECT_EQ(packed, CompactMesh(Sheet()));
  // This sheet: 0.1 of it; what is required is that it does not grow to a large part of it.
  EXPECT_LT(packed.size(), fs::file_size(folder / "scene/mesh.ply") / 4);
  fs::remove(folder / "scene/mesh.ply");
  EXPECT_THROW((void)CompactMap(folder / "", "mesh"), DataError);
}

TEST(CompactMesh, OfFewPartsOrWrongOnes) {
  float step = 0;
  EXPECT_TRUE(Unpacked(CompactMesh({}), step).vertices.empty());
  TriangleMesh mesh;
  mesh.vertices.assign(3, Eigen::Vector3f(0.25F, -0.5F, 1.0F));
  mesh.triangles = {{2, 0, 1}};
  const TriangleMesh read = Unpacked(CompactMesh(mesh), step);
  EXPECT_EQ(read.vertices, mesh.vertices) << "all at one place";
  EXPECT_EQ(read.triangles, mesh.triangles);
  mesh.triangles = {{2, 0, 3}};
  EXPECT_THROW((void)CompactMesh(mesh), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
