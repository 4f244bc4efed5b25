// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/compact_map.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>
#include <zlib.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "algo/motion/region.hpp"
#include "daemon/files/ply_file.hpp"
#include "daemon/files/scene_folder.hpp"
#include "drivers/files/image_file.hpp"
#include "words/scene_file.hpp"

namespace plumb {

namespace {

namespace fs = std::filesystem;

constexpr std::int16_t kNone = std::numeric_limits<std::int16_t>::min();
constexpr std::int16_t kMissing = std::numeric_limits<std::int16_t>::max();
constexpr float kSteps_per_m = 10000.0F;
constexpr float kLargestTenths = 32767.0F;

/// A zlib stream of the bytes. @throws IoError without memory
std::string Deflated(std::string_view bytes) {
  constexpr int kLevel = 6;
  uLongf size = compressBound(bytes.size());
  std::string stream(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(stream.data()), &size,
                reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), kLevel) != Z_OK)
    throw IoError(say::scene_file::NoMemory());
  stream.resize(size);
  return stream;
}

cv::Mat Tenths(const cv::Mat& metres) {
  cv::Mat tenths(metres.size(), CV_16SC1);
  for (int row = 0; row < metres.rows; ++row) {
    const float* in = metres.ptr<float>(row);
    auto* out = tenths.ptr<std::int16_t>(row);
    for (int column = 0; column < metres.cols; ++column) {
      const float value = in[column] * kSteps_per_m;
      out[column] = std::isnan(value) ? kNone
                                      : static_cast<std::int16_t>(std::lround(
                                            std::clamp(value, -kLargestTenths, kLargestTenths)));
    }
  }
  return tenths;
}

/// Results of older versions have no picture of the region; the compared part replaces it.
cv::Mat Region(const fs::path& result) {
  const cv::Mat deviation = ReadFloatTiff(result / "deviation.tiff");
  cv::Mat region(deviation.size(), CV_16SC1, cv::Scalar(kNone));
  std::error_code ignored;
  const bool has_picture = fs::exists(result / "region.png", ignored);
  const cv::Mat mask = has_picture ? ReadColorImage(result / "region.png")
                                   : ReadFloatTiff(result / "deviation_after.tiff");
  if (mask.size() != deviation.size()) throw DataError(say::scene_file::RegionSize());
  for (int row = 0; row < mask.rows; ++row) {
    for (int column = 0; column < mask.cols; ++column) {
      const bool inside = has_picture ? mask.at<cv::Vec3b>(row, column)[0] != 0
                                      : !std::isnan(mask.at<float>(row, column));
      if (!inside) continue;
      region.at<std::int16_t>(row, column) = std::isnan(deviation.at<float>(row, column)) ? 2 : 1;
    }
  }
  return region;
}

cv::Mat BodyRegion(const fs::path& scene_folder) {
  const Scene scene = ReadScene(scene_folder);
  if (!scene.height_map) throw DataError(say::scene_file::NoHeightMap());
  const std::vector<std::uint8_t> body = ReferenceRegion(scene, {});
  const GridShape& grid = scene.height_map->grid;
  cv::Mat region(grid.height, grid.width, CV_16SC1, cv::Scalar(kNone));
  for (std::size_t i = 0; i < body.size(); ++i)
    if (body[i] != 0) region.begin<std::int16_t>()[static_cast<std::ptrdiff_t>(i)] = 1;
  return region;
}

/// The smallest part that contains every value; one cell if there are none.
cv::Rect PartWithValues(const cv::Mat& map) {
  int left = map.cols, right = -1, top = map.rows, bottom = -1;
  for (int row = 0; row < map.rows; ++row) {
    const auto* cells = map.ptr<std::int16_t>(row);
    for (int column = 0; column < map.cols; ++column) {
      if (cells[column] == kNone) continue;
      left = std::min(left, column);
      right = std::max(right, column);
      top = std::min(top, row);
      bottom = row;
    }
  }
  return right < 0 ? cv::Rect(0, 0, 1, 1) : cv::Rect(left, top, right - left + 1, bottom - top + 1);
}

void Append(std::string& bytes, std::uint16_t value) {
  bytes += static_cast<char>(value & 0xFFU);
  bytes += static_cast<char>(value >> 8U);
}

std::string Packed(const cv::Mat& map) {
  if (map.cols > 0xFFFF || map.rows > 0xFFFF) throw DataError(say::scene_file::MapTooLarge());
  const cv::Rect part = PartWithValues(map);
  std::string bytes = "PLM1";
  for (const int number : {map.cols, map.rows, part.x, part.y, part.width, part.height})
    Append(bytes, static_cast<std::uint16_t>(number));
  std::string differences;
  differences.reserve(2 * static_cast<std::size_t>(part.area()));
  for (int row = part.y; row < part.y + part.height; ++row) {
    std::uint16_t before = 0;
    for (int column = part.x; column < part.x + part.width; ++column) {
      const auto cell = static_cast<std::uint16_t>(map.at<std::int16_t>(row, column));
      Append(differences, static_cast<std::uint16_t>(cell - before));
      before = cell;
    }
  }
  return bytes + Deflated(differences);
}

}  // namespace

std::string CompactMap(const fs::path& scan_folder, std::string_view name) {
  if (name == "mesh") return CompactMesh(ReadMeshPly(scan_folder / "scene/mesh.ply"));
  if (name == "region") return Packed(Region(scan_folder / "result"));
  if (name == "body") return Packed(BodyRegion(scan_folder / "scene"));
  if (name == "heightmap")
    return Packed(Tenths(ReadFloatTiff(scan_folder / "scene/heightmap.tiff")));
  if (name == "deviation" || name == "deviation_after")
    return Packed(Tenths(ReadFloatTiff(scan_folder / fmt::format("result/{}.tiff", name))));
  throw DataError(say::scene_file::NoSuchMap(name));
}

std::string CompactHeights(const HeightMap& heights, const std::vector<std::uint8_t>& missing) {
  cv::Mat tenths = Tenths(cv::Mat(heights.z).reshape(1, heights.grid.height));
  cv::min(tenths, kMissing - 1, tenths);
  for (std::size_t i = 0; i < missing.size(); ++i)
    if (missing[i] != 0) tenths.begin<std::int16_t>()[static_cast<std::ptrdiff_t>(i)] = kMissing;
  return Packed(tenths);
}

namespace {

constexpr float kMeshSteps = 65535.0F;
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
    throw DataError(say::scene_file::SurfaceTooLarge());
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  const Eigen::Vector3f least = box.isEmpty() ? Eigen::Vector3f(0, 0, 0) : box.min();
  // A single point still needs a step.
  const float step = box.isEmpty() ? 1.0F : std::max(box.sizes().maxCoeff() / kMeshSteps, 1e-6F);

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
      const float steps = std::clamp((vertex[axis] - least[axis]) / step, 0.0F, kMeshSteps);
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
