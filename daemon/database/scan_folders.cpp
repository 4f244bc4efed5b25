// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/scan_folders.hpp"

#include <algorithm>

#include "daemon/database/database.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {

namespace fs = std::filesystem;

std::vector<fs::path> ScanFolders::SetAsideAs(const std::string& begin) const {
  std::vector<fs::path> folders;
  for (const fs::path& aside : SetAside()) {
    std::error_code error;
    fs::directory_iterator entry(aside, error);
    for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
      if (entry->path().filename().string().starts_with(begin)) folders.push_back(entry->path());
    }
  }
  return folders;
}

std::vector<fs::path> ScanFolders::All() const {
  std::vector<fs::path> folders;
  std::error_code error;
  fs::directory_iterator entry(scans(), error);
  for (const fs::directory_iterator end; !error && entry != end; entry.increment(error)) {
    if (IsStaging(entry->path()) || ParseId(entry->path().filename().string()))
      folders.push_back(entry->path());
  }
  if (error && error != std::errc::no_such_file_or_directory) {
    throw DiskRefused(say::store::ScansUnlisted(scans().string(), error.message()));
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

}  // namespace plumb
