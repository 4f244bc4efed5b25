// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/import.hpp"

#include <array>
#include <optional>
#include <set>
#include <string>

#include "algo/base/errors.hpp"
#include "drivers/importers/image_folder.hpp"
#include "drivers/importers/phone_folder.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// What Plumb does not read, and the one command, or program, that makes it readable.
struct Unread {
  const char* ending;
  const char* format;
  const char* command;
};
constexpr std::array kUnread = {
    Unread{".zstd", "ROS 2 bag, packed as a whole", "zstd -d FILE"},
    Unread{".r3d", "Record3D .r3d", "Record3D: export as EXR + RGB"},
};

/// The file in a folder that `ros2 bag record` makes; nothing if it is no such folder.
/// @throws DataError if it has several.
std::optional<fs::path> RosBagIn(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_regular_file(folder / "metadata.yaml", error)) return std::nullopt;
  std::optional<fs::path> bag;
  for (fs::directory_iterator entry(folder, error), end; entry != end; entry.increment(error)) {
    const fs::path ending = entry->path().extension();
    if (ending != ".db3" && ending != ".mcap") continue;
    if (bag)
      throw DataError(say::foreign::NotReadYet(folder.string(), "ROS 2 bag of several files",
                                               "ros2 bag convert -i FOLDER -o one_file.yaml"));
    bag = entry->path();
  }
  return bag;
}

}  // namespace

bool IsImportable(const fs::path& path) {
  if (IsTumRecording(path)) return false;
  return IsFileRecording(path) || IsPhoneFolder(path) || IsImageFolder(path) || RosBagIn(path);
}

std::unique_ptr<ImportedRecording> OpenImported(const fs::path& path,
                                                const RecordingDefaults& defaults) {
  std::error_code error;
  if (const auto bag = RosBagIn(path)) return OpenFileRecording(*bag, defaults);
  if (IsPhoneFolder(path)) return OpenPhoneFolder(path, defaults);
  if (fs::is_directory(path, error)) return OpenImageFolderRecording(path, defaults);
  return OpenFileRecording(path, defaults);
}

void RefuseUnreadFormat(const fs::path& path) {
  const auto refuse = [](const fs::path& file) {
    for (const Unread& unread : kUnread)
      if (file.extension() == unread.ending)
        throw DataError(say::foreign::NotReadYet(file.string(), unread.format, unread.command));
  };
  refuse(path);
  std::error_code error;
  std::set<fs::path> files;  // In an order that does not depend on the disk.
  for (fs::directory_iterator entry(path, error), end; entry != end; entry.increment(error))
    files.insert(entry->path());
  for (const fs::path& file : files) refuse(file);
}

}  // namespace plumb
