// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/open_recorded_file.hpp"

#include <algorithm>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/importers/azure_mkv.hpp"
#include "drivers/importers/file_formats.hpp"
#include "drivers/importers/mcap_file.hpp"
#include "drivers/importers/ros_bag.hpp"
#include "drivers/importers/ros_database.hpp"
#include "drivers/importers/ros_recording.hpp"
#include "drivers/importers/sens_file.hpp"
#include "words/foreign.hpp"

namespace plumb {

std::unique_ptr<RecordedFile> OpenRecordedFile(FileBytes bytes) {
  std::vector<std::uint8_t> first(
      static_cast<std::size_t>(std::min<std::uint64_t>(kFirstBytes, bytes.size)));
  if (!bytes.read(0, first)) throw DataError(say::foreign::Unreadable());
  const std::optional<FileFormat> format = FormatOf(first);
  if (format == FileFormat::kRosBag)
    return OpenRosRecording(std::make_unique<RosBag>(std::move(bytes)));
  if (format == FileFormat::kRosDatabase)
    return OpenRosRecording(OpenRosDatabase(std::move(bytes)));
  if (format == FileFormat::kMcap)
    return OpenRosRecording(std::make_unique<McapFile>(std::move(bytes)));
  if (format == FileFormat::kMatroska) return OpenAzureMkv(std::move(bytes));
  if (format == FileFormat::kSens) return OpenSensFile(std::move(bytes));
  throw DataError(say::foreign::UnknownFormat());
}

}  // namespace plumb
