// Several files as one zip archive.
#pragma once

#include <string>
#include <vector>

namespace plumb::web {

struct ArchivedFile {
  std::string name;  ///< With '/' between folders.
  std::string bytes;
  bool is_compressed = false;  ///< Is stored as it is: a picture.
};

/// The archive's bytes. @throws IoError where memory is used up or a name is there twice.
[[nodiscard]] std::string ZipOf(const std::vector<ArchivedFile>& files);

}  // namespace plumb::web
