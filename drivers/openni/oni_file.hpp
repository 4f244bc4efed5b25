// SPDX-License-Identifier: Apache-2.0
// Reads the record structure of an .oni file, to check that it is complete.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// Result of scanning the records. The recorder starts the stamps of each stream at 0.
struct OniFileSummary {
  std::uint64_t end = 0;               ///< Offset after the END record.
  std::vector<std::int64_t> color_us;  ///< Stamps of the images, in order.
  std::vector<std::int64_t> depth_us;
};

/// Reads the span from an offset; false if the file is shorter.
using ReadBytes = std::function<bool(std::uint64_t offset, std::span<std::uint8_t> bytes)>;

/// Follows the records from the header to the END record. Nothing if the file is not an .oni file,
/// is damaged or has no END because the recorder was killed.
[[nodiscard]] std::optional<OniFileSummary> SummariseOniFile(const ReadBytes& read);
[[nodiscard]] std::optional<OniFileSummary> SummariseOniFile(const std::filesystem::path& file);

/// True once the file announces the data of that many streams. The recorder writes this on its own
/// thread and misses earlier images. False for a file that is being written elsewhere.
[[nodiscard]] bool HasOniDataBegun(const std::filesystem::path& file, int num_streams);

/// True for a regular file that begins like an .oni file.
[[nodiscard]] bool IsOniFile(const std::filesystem::path& file);

/// Removes what OpenNI2's recorder leaves after the END record (it extends files in advance, to
/// about twice their size) and flushes the file to the disk.
/// @throws IoError, also if the file has no END record.
OniFileSummary TrimOniFile(const std::filesystem::path& file);

/// Offsets that convert the streams' stamps to one clock.
struct OniBegin {
  std::int64_t color_us = 0;
  std::int64_t depth_us = 0;
};

/// Finds the start of one stream's stamps from stamps observed during the recording; some may be
/// missing on either side. Nothing if they do not match.
[[nodiscard]] std::optional<std::int64_t> FindOniBegin(std::span<const std::int64_t> recorded_us,
                                                       std::span<const std::int64_t> seen_us);

/// The calibration and the serial of an .oni file are stored beside it in `FILE.oni.yaml`, with the
/// keys of camera.yaml, `sensor_serial`, `color_begin_us` and `depth_begin_us`.
[[nodiscard]] std::filesystem::path OniSideCar(const std::filesystem::path& file);
[[nodiscard]] std::string OniBeginText(const OniBegin& begin);

/// The last two keys; zeros if they are missing or not numbers.
[[nodiscard]] OniBegin ParseOniBegin(std::string_view text);

}  // namespace plumb
