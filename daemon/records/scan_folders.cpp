#include "daemon/records/scan_folders.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "daemon/records/database.hpp"
#include "daemon/records/stored_values.hpp"

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
    throw DiskRefused(fmt::format("cannot list {}: {}; is its disk mounted and whole?",
                                  scans().string(), error.message()));
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

}  // namespace plumb
