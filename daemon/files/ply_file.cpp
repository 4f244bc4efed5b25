// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/ply_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "words/scene_file.hpp"

static_assert(std::endian::native == std::endian::little,
              "PLY is written and read as the bytes in memory");

namespace plumb {
namespace {

constexpr std::size_t kMaxFileBytes = std::size_t{2} << 30;
constexpr std::size_t kMaxHeaderBytes = std::size_t{1} << 14;
constexpr std::size_t kMaxElements = 100'000'000;

// ---- writing

template <typename T>
void Append(std::vector<std::uint8_t>& row, const T& value) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&value);
  row.insert(row.end(), bytes, bytes + sizeof value);
}

struct VertexColumns {
  const std::vector<Eigen::Vector3f>& points;
  const std::vector<Eigen::Vector3f>& normals;
  const std::vector<Color>& colors;
};

void CheckColumns(const VertexColumns& columns) {
  const std::size_t n = columns.points.size();
  if ((!columns.normals.empty() && columns.normals.size() != n) ||
      (!columns.colors.empty() && columns.colors.size() != n)) {
    throw std::invalid_argument(fmt::format("PLY: {} points with {} normals and {} colours", n,
                                            columns.normals.size(), columns.colors.size()));
  }
}

std::string VertexHeader(const VertexColumns& columns) {
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment metres\nelement vertex {}\nproperty float "
      "x\nproperty float y\nproperty float z\n",
      columns.points.size());
  if (!columns.normals.empty())
    header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!columns.colors.empty())
    header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  return header;
}

void WriteVertices(FileWriter& file, const VertexColumns& columns) {
  std::vector<std::uint8_t> row;
  for (std::size_t i = 0; i < columns.points.size(); ++i) {
    row.clear();
    for (int axis = 0; axis < 3; ++axis) Append(row, columns.points[i][axis]);
    if (!columns.normals.empty()) {
      for (int axis = 0; axis < 3; ++axis) Append(row, columns.normals[i][axis]);
    }
    if (!columns.colors.empty())
      row.insert(row.end(), columns.colors[i].begin(), columns.colors[i].end());
    file.Write(row);
  }
}

// ---- reading

enum class Scalar { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

std::optional<Scalar> ScalarOf(const std::string& name) {
  if (name == "char" || name == "int8") return Scalar::kInt8;
  if (name == "uchar" || name == "uint8") return Scalar::kUint8;
  if (name == "short" || name == "int16") return Scalar::kInt16;
  if (name == "ushort" || name == "uint16") return Scalar::kUint16;
  if (name == "int" || name == "int32") return Scalar::kInt32;
  if (name == "uint" || name == "uint32") return Scalar::kUint32;
  if (name == "float" || name == "float32") return Scalar::kFloat;
  if (name == "double" || name == "float64") return Scalar::kDouble;
  return std::nullopt;
}

std::size_t SizeOf(Scalar type) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

template <typename T>
double Load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<double>(value);
}

double Value(Scalar type, const std::uint8_t* at) {
  switch (type) {
    case Scalar::kInt8:
      return Load<std::int8_t>(at);
    case Scalar::kUint8:
      return Load<std::uint8_t>(at);
    case Scalar::kInt16:
      return Load<std::int16_t>(at);
    case Scalar::kUint16:
      return Load<std::uint16_t>(at);
    case Scalar::kInt32:
      return Load<std::int32_t>(at);
    case Scalar::kUint32:
      return Load<std::uint32_t>(at);
    case Scalar::kFloat:
      return Load<float>(at);
    case Scalar::kDouble:
      return Load<double>(at);
  }
  return 0.0;
}

struct Property {
  std::string name;
  Scalar type = Scalar::kFloat;
  std::size_t offset = 0;            ///< Offset in its row.
  std::optional<Scalar> list_count;  ///< Type of the length of a list.
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::size_t row_bytes = 0;  ///< Without lists.
  std::vector<Property> properties;
};

/// A parsed header and the bytes after it.
class PlyReader {
 public:
  PlyReader(std::span<const std::uint8_t> bytes, std::string name) : name_(std::move(name)) {
    constexpr std::string_view kEnd = "end_header\n";
    const std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                                std::min(bytes.size(), kMaxHeaderBytes));
    const std::size_t end = text.find(kEnd);
    if (!text.starts_with("ply\n") || end == std::string_view::npos)
      Fail(say::scene_file::PlyNoHeader());
    ParseHeader(std::string(text.substr(0, end)));
    body_ = bytes.subspan(end + kEnd.size());
    if (elements_.empty() || elements_[0].name != "vertex") Fail(say::scene_file::PlyNoVertex());
    Require(elements_[0].count * elements_[0].row_bytes);
  }

  [[nodiscard]] PointCloud Vertices() const {
    const Element& vertex = elements_[0];
    const auto position = Three(vertex, {"x", "y", "z"});
    if (!position) Fail(say::scene_file::PlyNoPosition());
    const auto normal = Three(vertex, {"nx", "ny", "nz"});
    const auto color = Three(vertex, {"red", "green", "blue"});
    PointCloud cloud;
    cloud.points.reserve(vertex.count);
    cloud.normals.reserve(normal ? vertex.count : 0);
    cloud.colors.reserve(color ? vertex.count : 0);
    const std::uint8_t* row = body_.data();
    for (std::size_t i = 0; i < vertex.count; ++i, row += vertex.row_bytes) {
      cloud.points.push_back(Vector(*position, row));
      if (!cloud.points.back().allFinite()) Fail(say::scene_file::PlyVertexNotFinite(Index(i)));
      if (normal) {
        cloud.normals.push_back(Vector(*normal, row));
        if (!cloud.normals.back().allFinite()) Fail(say::scene_file::PlyNormalNotFinite(Index(i)));
      }
      if (color) {
        Color& out = cloud.colors.emplace_back();
        for (std::size_t c = 0; c < 3; ++c) {
          const double value = Value((*color)[c].type, row + (*color)[c].offset);
          if (!std::isfinite(value)) Fail(say::scene_file::PlyColorNotFinite(Index(i)));
          out[c] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
        }
      }
    }
    return cloud;
  }

  [[nodiscard]] std::vector<float> VertexProperty(std::string_view name) const {
    const Element& vertex = elements_[0];
    const Property* const property = Find(vertex, name);
    std::vector<float> values;
    if (property == nullptr) return values;
    values.reserve(vertex.count);
    for (std::size_t i = 0; i < vertex.count; ++i) {
      const std::uint8_t* at = body_.data() + i * vertex.row_bytes + property->offset;
      values.push_back(static_cast<float>(Value(property->type, at)));
    }
    return values;
  }

  [[nodiscard]] std::vector<std::array<std::uint32_t, 3>> Triangles() const {
    const Element& vertex = elements_[0];
    if (elements_.size() < 2 || elements_[1].name != "face") Fail(say::scene_file::PlyNoFaces());
    const Element& face = elements_[1];
    if (face.properties.size() != 1 || !face.properties[0].list_count)
      Fail(say::scene_file::PlyNoPlainFaces());
    const Scalar count_type = *face.properties[0].list_count;
    const Scalar index_type = face.properties[0].type;
    const std::size_t row_bytes = SizeOf(count_type) + 3 * SizeOf(index_type);
    const std::size_t begin = vertex.count * vertex.row_bytes;
    Require(begin + face.count * row_bytes);
    std::vector<std::array<std::uint32_t, 3>> triangles(face.count);
    const std::uint8_t* row = body_.data() + begin;
    for (std::size_t i = 0; i < face.count; ++i, row += row_bytes) {
      const double corners = Value(count_type, row);
      if (corners != 3) Fail(say::scene_file::PlyNoTriangle(Index(i), corners));
      for (std::size_t k = 0; k < 3; ++k) {
        const double index = Value(index_type, row + SizeOf(count_type) + k * SizeOf(index_type));
        if (!(index >= 0 && index < static_cast<double>(vertex.count))) {
          Fail(say::scene_file::PlyNoSuchVertex(Index(i), fmt::to_string(index),
                                                Index(vertex.count)));
        }
        triangles[i][k] = static_cast<std::uint32_t>(index);
      }
    }
    return triangles;
  }

 private:
  using Columns = std::array<Property, 3>;

  static std::int64_t Index(std::size_t index) { return static_cast<std::int64_t>(index); }

  [[noreturn]] void Fail(const Message& why) const {
    throw DataError(say::scene_file::Ply(name_, why));
  }

  void Require(std::size_t bytes) const {
    if (body_.size() < bytes) {
      Fail(say::scene_file::PlyTruncated(Index(body_.size()), Index(bytes)));
    }
  }

  void ParseHeader(const std::string& text) {
    std::istringstream lines(text);
    std::string line;
    bool has_format = false;
    std::getline(lines, line);  // "ply"
    while (std::getline(lines, line)) {
      std::istringstream words(line);
      std::string key;
      words >> key;
      if (key.empty() || key == "comment" || key == "obj_info") continue;
      if (key == "format") {
        std::string format;
        words >> format;
        if (format != "binary_little_endian")
          Fail(say::scene_file::PlyFormat(format.substr(0, 40)));
        has_format = true;
      } else if (key == "element") {
        AddElement(words);
      } else if (key == "property" && !elements_.empty()) {
        AddProperty(words, elements_.back());
      } else {
        Fail(say::scene_file::PlyLine(line.substr(0, 60)));
      }
    }
    if (!has_format) Fail(say::scene_file::PlyNoFormat());
  }

  void AddElement(std::istringstream& words) {
    Element element;
    std::uint64_t count = 0;
    if (!(words >> element.name >> count) || count > kMaxElements) {
      Fail(say::scene_file::PlyCount(kMaxElements));
    }
    element.count = static_cast<std::size_t>(count);
    elements_.push_back(std::move(element));
  }

  void AddProperty(std::istringstream& words, Element& element) const {
    Property property;
    std::string type;
    words >> type;
    if (type == "list") {
      std::string count_type;
      words >> count_type >> type;
      property.list_count = ScalarOf(count_type);
      if (!property.list_count || element.name == "vertex") Fail(say::scene_file::PlyList());
    }
    const std::optional<Scalar> scalar = ScalarOf(type);
    if (!scalar || !(words >> property.name))
      Fail(say::scene_file::PlyProperty(type.substr(0, 40)));
    property.type = *scalar;
    property.offset = element.row_bytes;
    element.row_bytes += SizeOf(*scalar);
    element.properties.push_back(std::move(property));
  }

  static const Property* Find(const Element& element, std::string_view name) {
    const auto at = std::find_if(element.properties.begin(), element.properties.end(),
                                 [&](const Property& p) { return p.name == name; });
    return at == element.properties.end() ? nullptr : &*at;
  }

  static std::optional<Columns> Three(const Element& element,
                                      const std::array<std::string_view, 3>& names) {
    Columns columns;
    for (std::size_t i = 0; i < 3; ++i) {
      const Property* const property = Find(element, names[i]);
      if (property == nullptr) return std::nullopt;
      columns[i] = *property;
    }
    return columns;
  }

  static Eigen::Vector3f Vector(const Columns& columns, const std::uint8_t* row) {
    Eigen::Vector3f vector;
    for (std::size_t i = 0; i < 3; ++i) {
      vector[static_cast<Eigen::Index>(i)] =
          static_cast<float>(Value(columns[i].type, row + columns[i].offset));
    }
    return vector;
  }

  std::string name_;
  std::vector<Element> elements_;
  std::span<const std::uint8_t> body_;
};

}  // namespace

void WriteCloudPly(const std::filesystem::path& path, const PointCloud& cloud) {
  const VertexColumns columns{cloud.points, cloud.normals, cloud.colors};
  CheckColumns(columns);
  FileWriter file(path);
  file.Write(VertexHeader(columns) + "end_header\n");
  WriteVertices(file, columns);
  file.Close();
}

void WriteMeshPly(const std::filesystem::path& path, const TriangleMesh& mesh) {
  const VertexColumns columns{mesh.vertices, mesh.normals, mesh.colors};
  CheckColumns(columns);
  for (const auto& triangle : mesh.triangles) {
    if (*std::max_element(triangle.begin(), triangle.end()) >= mesh.vertices.size()) {
      throw std::invalid_argument(fmt::format(
          "PLY: a triangle names a vertex that is not there ({} vertices)", mesh.vertices.size()));
    }
  }
  FileWriter file(path);
  file.Write(VertexHeader(columns) +
             fmt::format("element face {}\nproperty list uchar int vertex_indices\nend_header\n",
                         mesh.triangles.size()));
  WriteVertices(file, columns);
  std::vector<std::uint8_t> row;
  for (const auto& triangle : mesh.triangles) {
    row.assign(1, 3);
    for (const std::uint32_t index : triangle) Append(row, index);
    file.Write(row);
  }
  file.Close();
}

PointCloud ParseCloudPly(std::span<const std::uint8_t> bytes, const std::string& name) {
  return PlyReader(bytes, name).Vertices();
}

PointCloud ReadCloudPly(const std::filesystem::path& path) {
  return ParseCloudPly(ReadWholeFile(path, kMaxFileBytes), path.string());
}

TriangleMesh ParseMeshPly(std::span<const std::uint8_t> bytes, const std::string& name) {
  const PlyReader reader(bytes, name);
  PointCloud vertices = reader.Vertices();
  TriangleMesh mesh;
  mesh.vertices = std::move(vertices.points);
  mesh.normals = std::move(vertices.normals);
  mesh.colors = std::move(vertices.colors);
  mesh.triangles = reader.Triangles();
  return mesh;
}

std::vector<float> ParseVertexProperty(std::span<const std::uint8_t> bytes, const std::string& name,
                                       std::string_view property) {
  return PlyReader(bytes, name).VertexProperty(property);
}

TriangleMesh ReadMeshPly(const std::filesystem::path& path) {
  return ParseMeshPly(ReadWholeFile(path, kMaxFileBytes), path.string());
}

}  // namespace plumb
