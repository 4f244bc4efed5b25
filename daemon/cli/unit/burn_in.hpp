// SPDX-License-Identifier: Apache-2.0
// The burn-in of a new or repaired unit: hours of its normal work, with every result compared with
// the first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "daemon/cli/unit/doctor_report.hpp"

namespace plumb {

struct BurnInOptions {
  double minutes = 60.0;
  std::filesystem::path folder;   ///< On the disk under test; needs about 200 MB.
  std::filesystem::path control;  ///< Socket of plumbd, which uses the sensor; it may be missing.
  int frames = 40;                ///< For each simulated sweep.
};

/// Scans a simulated body, with results that must have the same bits each time; writes patterns to
/// memory; reads files back from the disk; monitors the sensor of a running plumbd. At least two
/// rounds. Adds the findings to the report.
/// @throws Interrupted on a stop request.
void BurnIn(const BurnInOptions& options, const CommandContext& context, DoctorReport& report);

/// Writes a file, flushes it to the disk, drops it from memory if the system permits, and reads it
/// back.
/// @param between  Called before it is read.
/// @returns empty, or the error.
[[nodiscard]] Message TestDisk(
    const std::filesystem::path& folder, std::size_t bytes, std::uint64_t seed,
    const std::function<void(const std::filesystem::path& file)>& between = {});

/// Fills memory with patterns and reads them back.
/// @param between  Called with the memory before it is read.
/// @returns empty, or the error.
[[nodiscard]] Message TestMemory(
    std::size_t bytes, std::uint64_t seed,
    const std::function<void(std::uint64_t* words, std::size_t count)>& between = {});

/// The first difference between two results of the same work; empty if there is none.
[[nodiscard]] Message FirstDifference(const std::string& first, const std::string& now);

}  // namespace plumb
