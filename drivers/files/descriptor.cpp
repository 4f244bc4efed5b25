#include "drivers/files/descriptor.hpp"

#include <cerrno>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

void WriteAll(const Descriptor& file, std::string_view bytes, const std::filesystem::path& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file.get(), bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) throw IoError(DescribeWriteError(path, written < 0 ? errno : EIO));
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

}  // namespace plumb
