#include "daemon/files/compact_mesh.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>

#include <Eigen/Geometry>

#include "algo/base/errors.hpp"
#include "daemon/files/deflated.hpp"

namespace plumb {
namespace {

constexpr float kSteps = 65535.0F;
constexpr std::size_t kMostParts = std::size_t{1} << 25;  // a browser reads no more

void AppendNumber(std::string& bytes, std::uint32_t value, int num_bytes) {
  for (int i = 0; i < num_bytes; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFFU);
}

void AppendDifference(std::string& bytes, std::int64_t difference) {
  auto zigzag = static_cast<std::uint64_t>(difference) << 1U;
  if (difference < 0) zigzag = ~zigzag;
  for (; zigzag >= 0x80; zigzag >>= 7U) bytes += static_cast<char>((zigzag & 0x7FU) | 0x80U);
  bytes += static_cast<char>(zigzag);
}

}  // namespace

std::string CompactMesh(const TriangleMesh& mesh) {
  if (std::max(mesh.vertices.size(), mesh.triangles.size()) > kMostParts)
    throw DataError("this surface is too large");
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  const Eigen::Vector3f least = box.isEmpty() ? Eigen::Vector3f(0, 0, 0) : box.min();
  // A single point still needs a step.
  const float step = box.isEmpty() ? 1.0F : std::max(box.sizes().maxCoeff() / kSteps, 1e-6F);

  std::string bytes = "PLM2";
  AppendNumber(bytes, static_cast<std::uint32_t>(mesh.vertices.size()), 4);
  AppendNumber(bytes, static_cast<std::uint32_t>(mesh.triangles.size()), 4);
  for (const float number : {least.x(), least.y(), least.z(), step})
    AppendNumber(bytes, std::bit_cast<std::uint32_t>(number), 4);

  std::string content;
  content.reserve(6 * mesh.vertices.size() + 6 * mesh.triangles.size());
  for (int axis = 0; axis < 3; ++axis) {
    std::uint32_t before = 0;
    for (const Eigen::Vector3f& vertex : mesh.vertices) {
      const float steps = std::clamp((vertex[axis] - least[axis]) / step, 0.0F, kSteps);
      const auto now = static_cast<std::uint32_t>(std::lround(steps));
      AppendNumber(content, now - before, 2);
      before = now;
    }
  }
  std::int64_t before = 0;
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t corner : triangle) {
      if (corner >= mesh.vertices.size())
        throw std::invalid_argument("a triangle names a vertex that is not there");
      AppendDifference(content, static_cast<std::int64_t>(corner) - before);
      before = corner;
    }
  }
  return bytes + Deflated(content);
}

}  // namespace plumb
