// SPDX-License-Identifier: Apache-2.0
// The record of a session of live monitoring on the disk: every frame's numbers, settings and
// events, no images. It grows while the session goes on, and a power cut takes its last second.
//
// "PLUMBMON", u32 version, then blocks: u32 kind, u32 length, payload, u32 CRC-32 of all three.
// Kinds: 1, a text of JSON (the first block is the head, the others are events); 2, frames of 104
// bytes. Little-endian.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "daemon/monitoring_files/monitoring_folder.hpp"
#include "drivers/files/descriptor.hpp"

namespace plumb {

/// In a scan's folder; the records are numbered there.
inline constexpr const char* kMonitoringFolder = "monitoring";
inline constexpr int kMostMonitoringFiles = 20;
/// Two hours of one sensor at 30 Hz; then the record ends, and the session goes on.
inline constexpr std::uint64_t kMostMonitoringBytes = 24'000'000;

/// "01.plm". @param number  From 1.
[[nodiscard]] std::string MonitoringFileName(int number);

/// Now, as it is written there: UTC.
[[nodiscard]] std::string MonitoringTime();

/// Not thread-safe.
class MonitoringFileWriter {
 public:
  /// Creates the file, never the folders above that of the records. @throws IoError
  MonitoringFileWriter(std::filesystem::path file, const nlohmann::json& head);

  /// @throws IoError
  void AddFrames(std::span<const MonitorLine> lines);
  /// @throws IoError
  void AddEvent(const nlohmann::json& event);
  /// What was added is on the disk afterwards. @throws IoError
  void Sync();
  /// Whether another second of frames has room within kMostMonitoringBytes.
  [[nodiscard]] bool HasRoom() const;

 private:
  void AddBlock(std::uint32_t kind, std::string_view payload);

  std::filesystem::path path_;
  Descriptor file_;
  std::uint64_t bytes_ = 0;
};

/// A record as it was read.
struct StoredMonitoring {
  nlohmann::json head;
  MonitoringRecord record;  ///< Lines and has_reference only.
  std::vector<nlohmann::json> events;
  bool is_cut_off = false;  ///< The last block is not whole, as after a power cut.
};

/// Values that were stored rounded: 1 um or 1 urad of an interval, 0.1 per mille of what is seen.
/// @throws DataError if it is not such a file, too long, or damaged before its last block.
[[nodiscard]] StoredMonitoring ReadMonitoringFile(const std::filesystem::path& file);
/// The same of its bytes. @param file  Named in errors.
[[nodiscard]] StoredMonitoring ParseMonitoring(std::string_view bytes,
                                               const std::filesystem::path& file);
/// The head alone. @throws DataError
[[nodiscard]] nlohmann::json ReadMonitoringHead(const std::filesystem::path& file);

/// Numbers of the records of a scan; empty without any.
/// @param scan  Its folder.
[[nodiscard]] std::vector<int> MonitoringFilesOf(const std::filesystem::path& scan);

/// What the report page shows: time in each state and advice, holds, drift, breathing, motion,
/// events (the first few hundred).
[[nodiscard]] nlohmann::ordered_json MonitoringReport(const StoredMonitoring& stored);

}  // namespace plumb
