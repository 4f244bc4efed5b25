// The drivers that OpenNI2 finds beside its library: Debian's, and those of other makers' sensors.
// OpenNI2 passes over one that it cannot use without a word; here is said why.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace plumb {

struct OpenNiDriverFile {
  std::filesystem::path file;
  std::string serves;       ///< Which sensors, in words.
  bool is_debians = false;  ///< Part of Debian's package libopenni2-0.
  std::string problem;      ///< Why OpenNI2 does not use it, and what to do; empty: it does.
};

/// Where OpenNI2 looks for drivers: `OpenNI2/Drivers` beside the library that this program loads;
/// nothing if it cannot be loaded.
[[nodiscard]] std::optional<std::filesystem::path> OpenNiDriverFolder();

/// In the order of their names; `libNAME.so` is left out where `libNAME.so.0` is there too. Each is
/// loaded to see whether it can be: its own code runs.
[[nodiscard]] std::vector<OpenNiDriverFile> FindOpenNiDrivers(const std::filesystem::path& folder);

}  // namespace plumb
