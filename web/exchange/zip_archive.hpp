// SPDX-License-Identifier: Apache-2.0
// Several files as one zip archive.
#pragma once

#include <string>
#include <vector>

namespace plumb::web {

struct ArchivedFile {
  std::string name;  ///< With '/' between folders.
  std::string bytes;
  bool is_compressed = false;  ///< Already compressed, such as a picture.
};

/// The archive's bytes. @throws IoError if memory is exhausted or a name occurs twice.
[[nodiscard]] std::string ZipOf(const std::vector<ArchivedFile>& files);

}  // namespace plumb::web
