// SPDX-License-Identifier: Apache-2.0
// Files that were received and wait for a physicist.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace plumb {

struct SpoolLimits {
  std::uint64_t most_bytes = 0;
  std::chrono::hours keep{0};
};

/// What is known of a received file without reading it.
struct SpoolNote {
  std::string calling_ae_title, address, class_uid, instance_uid;
};

/// A folder with NAME.dcm and NAME.json for each received file. Names are our own, never those of a
/// sender. Several processes may use it.
class Spool {
 public:
  /// @throws IoError if there is no such folder.
  Spool(std::filesystem::path folder, const SpoolLimits& limits);

  /// Removes what is older than it may be, and what a process that was killed left behind.
  void RemoveOld() const;

  /// A name for a file that is being received; nothing if the spool is full.
  [[nodiscard]] std::optional<std::filesystem::path> NewFile() const;

  /// Makes a complete file durable and visible, its note first. False if the disk refuses; the file
  /// is then gone.
  [[nodiscard]] bool Keep(const std::filesystem::path& file, const SpoolNote& note) const;

 private:
  [[nodiscard]] std::uint64_t Bytes() const;

  std::filesystem::path folder_;
  SpoolLimits limits_;
};

}  // namespace plumb
