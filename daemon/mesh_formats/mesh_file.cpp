// SPDX-License-Identifier: Apache-2.0
#include "daemon/mesh_formats/mesh_file.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/ply_file.hpp"
#include "drivers/files/file_io.hpp"
#include "words/output.hpp"

namespace plumb {
namespace {

void CheckTriangles(const TriangleMesh& mesh) {
  if (mesh.triangles.size() > std::numeric_limits<std::uint32_t>::max())
    throw std::invalid_argument("mesh: too many triangles");
  for (const auto& triangle : mesh.triangles) {
    if (*std::max_element(triangle.begin(), triangle.end()) >= mesh.vertices.size()) {
      throw std::invalid_argument(fmt::format(
          "mesh: a triangle names a vertex that is not there ({} vertices)", mesh.vertices.size()));
    }
  }
}

std::string EndingOf(const std::filesystem::path& path) {
  return AsciiLower(path.extension().string());
}

TriangleMesh InUnit(TriangleMesh mesh, MeshUnit unit) {
  if (unit == MeshUnit::kMillimetres)
    for (Eigen::Vector3f& vertex : mesh.vertices) vertex *= 1000.0F;
  return mesh;
}

const char* UnitInWords(MeshUnit unit) {
  return unit == MeshUnit::kMetres ? "metres" : "millimetres";
}

}  // namespace

MeshUnit UsualUnit(const std::filesystem::path& path) {
  const std::string ending = EndingOf(path);
  if (ending == ".stl") return MeshUnit::kMillimetres;
  if (ending == ".ply" || ending == ".obj") return MeshUnit::kMetres;
  throw InvalidRequest(say::output::MeshEnding(path.string()));
}

void WriteMeshStl(const std::filesystem::path& path, const TriangleMesh& mesh, MeshUnit unit) {
  CheckTriangles(mesh);
  FileWriter file(path);
  // Must not begin with "solid", the mark of the text format.
  std::string header = fmt::format("Plumb mesh in {}", UnitInWords(unit));
  header.resize(80, ' ');
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  header.append(reinterpret_cast<const char*>(&count), sizeof count);
  file.Write(header);
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices[triangle[0]];
    const Eigen::Vector3f& b = mesh.vertices[triangle[1]];
    const Eigen::Vector3f& c = mesh.vertices[triangle[2]];
    // normalized() leaves a vector of length zero, which means "unknown" in this format, unchanged.
    const Eigen::Vector3f normal = (b - a).cross(c - a).normalized();
    std::uint8_t row[50] = {};
    std::memcpy(row, normal.data(), 12);
    std::memcpy(row + 12, a.data(), 12);
    std::memcpy(row + 24, b.data(), 12);
    std::memcpy(row + 36, c.data(), 12);
    file.Write(std::span<const std::uint8_t>(row));
  }
  file.Close();
}

void WriteMeshObj(const std::filesystem::path& path, const TriangleMesh& mesh, MeshUnit unit) {
  CheckTriangles(mesh);
  const bool has_colors = mesh.colors.size() == mesh.vertices.size();
  const bool has_normals = mesh.normals.size() == mesh.vertices.size();
  FileWriter file(path);
  file.Write(fmt::format("# Plumb mesh in {}\n", UnitInWords(unit)));
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3f& v = mesh.vertices[i];
    std::string line = fmt::format("v {:.6f} {:.6f} {:.6f}", v.x(), v.y(), v.z());
    if (has_colors) {
      line += fmt::format(" {:.4f} {:.4f} {:.4f}", mesh.colors[i][0] / 255.0,
                          mesh.colors[i][1] / 255.0, mesh.colors[i][2] / 255.0);
    }
    line += '\n';
    file.Write(line);
  }
  if (has_normals) {
    for (const Eigen::Vector3f& n : mesh.normals)
      file.Write(fmt::format("vn {:.5f} {:.5f} {:.5f}\n", n.x(), n.y(), n.z()));
  }
  for (const auto& triangle : mesh.triangles) {
    std::string line = "f";
    for (const std::uint32_t index : triangle) {
      line += has_normals ? fmt::format(" {}//{}", index + 1, index + 1)
                          : fmt::format(" {}", index + 1);
    }
    line += '\n';
    file.Write(line);
  }
  file.Close();
}

void WriteMeshFile(const std::filesystem::path& path, const TriangleMesh& mesh, MeshUnit unit) {
  static_cast<void>(UsualUnit(path));  // Refuses another extension.
  const TriangleMesh scaled = InUnit(mesh, unit);
  const std::string ending = EndingOf(path);
  WriteFileAtomically(path, [&](const std::filesystem::path& hidden) {
    if (ending == ".ply") WriteMeshPly(hidden, scaled);
    if (ending == ".stl") WriteMeshStl(hidden, scaled, unit);
    if (ending == ".obj") WriteMeshObj(hidden, scaled, unit);
  });
}

}  // namespace plumb
