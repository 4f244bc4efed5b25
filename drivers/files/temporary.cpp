// SPDX-License-Identifier: Apache-2.0
#include "drivers/files/temporary.hpp"

#include <fcntl.h>
#include <stdlib.h>

#include <cerrno>
#include <system_error>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

// The C library replaces six of these letters by a name that is free.
std::string Template(const std::filesystem::path& folder, const std::string& prefix) {
  return (folder / (prefix + std::string(6, 'X'))).string();
}

}  // namespace

TemporaryFolder::TemporaryFolder(const std::filesystem::path& parent, const std::string& prefix) {
  std::string name = Template(parent, prefix);
  if (::mkdtemp(name.data()) == nullptr) throw IoError(DescribeWriteError(parent, errno));
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

UniqueFile MakeUniqueFile(const std::filesystem::path& folder, const std::string& prefix,
                          const std::string& extension) {
  std::string name = Template(folder, prefix) + extension;
  const int descriptor = ::mkostemps(name.data(), static_cast<int>(extension.size()), O_CLOEXEC);
  if (descriptor < 0) throw IoError(DescribeWriteError(folder, errno));
  return {name, descriptor};
}

}  // namespace plumb
