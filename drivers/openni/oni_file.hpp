// The records of an .oni file, as far as its whole length and its kind are concerned.
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

/// The result of reading along the records. The recorder lets the stamps of each stream begin at 0.
struct OniFileSummary {
  std::uint64_t end = 0;               ///< Offset behind the END record.
  std::vector<std::int64_t> color_us;  ///< Stamps of the images, in order.
  std::vector<std::int64_t> depth_us;
};

/// Fills the span from an offset; false where the file is shorter.
using ReadBytes = std::function<bool(std::uint64_t offset, std::span<std::uint8_t> bytes)>;

/// Follows the records from the header to the END record. Nothing if the file is no .oni file, is
/// damaged or has no END: the recorder was killed, or it is no recording.
[[nodiscard]] std::optional<OniFileSummary> SummariseOniFile(const ReadBytes& read);
[[nodiscard]] std::optional<OniFileSummary> SummariseOniFile(const std::filesystem::path& file);

/// True once the file says that the data of so many streams begin. The recorder writes that on a
/// thread of its own and misses what comes before. False for a file that is being written
/// elsewhere.
[[nodiscard]] bool HasOniDataBegun(const std::filesystem::path& file, int num_streams);

/// True if it is a regular file that begins as .oni files do.
[[nodiscard]] bool IsOniFile(const std::filesystem::path& file);

/// Cuts off what the recorder of OpenNI2 leaves behind the END record (it grows files ahead, to
/// about twice their size) and forces the file to the disk. @throws IoError, also if the file has
/// no END record.
OniFileSummary TrimOniFile(const std::filesystem::path& file);

/// Offsets that bring the streams' stamps onto one clock.
struct OniBegin {
  std::int64_t color_us = 0;
  std::int64_t depth_us = 0;
};

/// Finds out where the stamps of one stream began, from stamps that were seen while it was
/// recorded; some may have been missed on either side. Nothing if they do not fit.
[[nodiscard]] std::optional<std::int64_t> FindOniBegin(std::span<const std::int64_t> recorded_us,
                                                       std::span<const std::int64_t> seen_us);

/// The calibration and the serial that belong to an .oni file lie beside it: `FILE.oni.yaml`, with
/// the keys of camera.yaml, `sensor_serial`, and `color_begin_us` and `depth_begin_us`.
[[nodiscard]] std::filesystem::path OniSideCar(const std::filesystem::path& file);
[[nodiscard]] std::string OniBeginText(const OniBegin& begin);

/// The last two keys; zeros where they are missing or no numbers.
[[nodiscard]] OniBegin ParseOniBegin(std::string_view text);

}  // namespace plumb
