// The burn-in of a new or repaired unit: hours of the work that it will do, with every result held
// against the first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "daemon/cli/doctor_report.hpp"

namespace plumb {

struct BurnInOptions {
  double minutes = 60.0;
  std::filesystem::path folder;   ///< On the disk under test; needs about 200 MB.
  std::filesystem::path control;  ///< Socket of plumbd, which has the sensor; it may be missing.
  int frames = 40;                ///< Of each simulated sweep.
};

/// Scans of a simulated body, whose results must be the same bits each time; patterns in memory;
/// files read back from the disk; the sensor of a running plumbd. At least two rounds. Adds to the
/// report what was found.
/// @throws Interrupted on a stop request.
void BurnIn(const BurnInOptions& options, const std::stop_token& stop, DoctorReport& report);

/// Writes a file, forces it to the disk, drops it from memory where the system lets it, and reads
/// it back. @param between  Called before it is read. @returns empty, or what is wrong.
[[nodiscard]] std::string TestDisk(
    const std::filesystem::path& folder, std::size_t bytes, std::uint64_t seed,
    const std::function<void(const std::filesystem::path& file)>& between = {});

/// Fills memory with patterns and reads them back. @param between  Called with the memory before it
/// is read. @returns empty, or what is wrong.
[[nodiscard]] std::string TestMemory(
    std::size_t bytes, std::uint64_t seed,
    const std::function<void(std::uint64_t* words, std::size_t count)>& between = {});

/// Where two results of the same work differ; empty: nowhere.
[[nodiscard]] std::string FirstDifference(const std::string& first, const std::string& now);

}  // namespace plumb
