// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/import.hpp"

#include <array>
#include <string>

#include "algo/base/errors.hpp"
#include "drivers/importers/image_folder.hpp"
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
    Unread{".mkv", "Azure Kinect / Femto .mkv",
           "python3 examples/python/reconstruction_system/sensors/azure_kinect_mkv_reader.py "
           "--input FILE --output FOLDER (Open3D)"},
    Unread{".db3", "ROS 2 bag (.db3)", "rosbags-convert --src FOLDER --dst FILE.bag"},
    Unread{".mcap", "ROS 2 bag (.mcap)", "rosbags-convert --src FOLDER --dst FILE.bag"},
    Unread{".r3d", "Record3D .r3d", "Record3D: export as EXR + RGB"},
    Unread{".db", "RTAB-Map .db", "rtabmap-export --images_id FILE.db"},
};

}  // namespace

bool IsImportable(const fs::path& path) {
  if (IsTumRecording(path)) return false;
  return IsFileRecording(path) || IsImageFolder(path);
}

std::unique_ptr<ImportedRecording> OpenImported(const fs::path& path,
                                                const RecordingDefaults& defaults) {
  std::error_code error;
  if (fs::is_directory(path, error)) return OpenImageFolderRecording(path, defaults);
  return OpenFileRecording(path, defaults);
}

void RefuseUnreadFormat(const fs::path& path) {
  for (const Unread& unread : kUnread)
    if (path.extension() == unread.ending)
      throw DataError(say::foreign::NotReadYet(path.string(), unread.format, unread.command));
}

}  // namespace plumb
