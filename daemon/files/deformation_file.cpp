#include "daemon/files/deformation_file.hpp"

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "drivers/files/file_io.hpp"

static_assert(std::endian::native == std::endian::little, "PLY is written as the bytes in memory");

namespace plumb {

void WriteDeformationPly(const std::filesystem::path& path, const Deformation& deformation) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment metres; d: what the rigid correction "
      "leaves\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
      "property float dx\nproperty float dy\nproperty float dz\nproperty uchar observed\n"
      "end_header\n",
      deformation.points.size());
  const auto append = [&](const Eigen::Vector3f& v) {
    bytes.append(reinterpret_cast<const char*>(v.data()), 3 * sizeof(float));
  };
  for (std::size_t i = 0; i < deformation.points.size(); ++i) {
    append(deformation.points[i]);
    append(deformation.shifts_m[i]);
    bytes.push_back(static_cast<char>(deformation.observed[i]));
  }
  WriteWholeFile(path, std::string_view(bytes));
}

}  // namespace plumb
