// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/kept_scenes.hpp"

#include <sys/stat.h>
#include <unistd.h>

#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/simulator/player/frame_cache.hpp"

namespace plumb::simulated {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t kMaxBytes = 1 << 20;

/// Another one for each file that is put in its place and whenever it is written; empty if there is
/// none.
std::string StampOf(const fs::path& file) {
  struct stat found {};
  if (::stat(file.c_str(), &found) != 0) return {};
  return fmt::format("{} {} {} {}.{:09}", found.st_dev, found.st_ino, found.st_size,
                     found.st_mtim.tv_sec, found.st_mtim.tv_nsec);
}

/// All that decides which frames are shown. A new option does not compile until it is here.
std::string KeyOf(const VirtualSensorOptions& options) {
  const auto& [suite, seed, frames, width, height, max_scenes, at_rest, rest_steps, second_serial,
               plugged, board_centres_m, room] = static_cast<const SimulatedSweeps&>(options);
  (void)plugged;  // the frames are the same
  std::string key = fmt::format("{} {} {} {}x{} {} {} {} {} {} {} {:a}", suite, seed, frames, width,
                                height, max_scenes, at_rest, rest_steps, !second_serial.empty(),
                                room ? fmt::format("room {}", *room) : "",
                                static_cast<int>(options.noise), options.rate_hz);
  for (const auto& [id, centre_m] : board_centres_m)
    key += fmt::format(" {}:{:a},{:a}", id, centre_m.x(), centre_m.y());
  return key;
}

/// The program with what is linked into it: the simulator and the libraries of the method.
json ProgramAndKey(const VirtualSensorOptions& options) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const std::string stamp = error ? std::string() : StampOf("/proc/self/exe");
  if (stamp.empty()) return {};
  return {{"program", program.string()}, {"program_stamp", stamp}, {"options", KeyOf(options)}};
}

/// One for each program and its options, so that none of a former build is left over.
fs::path FileFor(const fs::path& folder, const json& of) {
  const std::string name = of["program"].get<std::string>() + of["options"].get<std::string>();
  return folder / fmt::format("{:016x}.scenes", std::hash<std::string>{}(name));
}

json FilesToJson(const std::vector<fs::path>& files) {
  json list = json::array();
  for (const fs::path& file : files)
    list.push_back({{"name", file.filename().string()}, {"stamp", StampOf(file)}});
  return list;
}

/// @throws std::exception unless all are as they were.
std::vector<fs::path> FilesFromJson(const json& list, const fs::path& folder) {
  std::vector<fs::path> files;
  for (const json& one : list) {
    files.push_back(folder / fs::path(one.at("name").get<std::string>()).filename());
    const std::string stamp = StampOf(files.back());
    if (stamp.empty() || stamp != one.at("stamp")) throw std::runtime_error("another file");
  }
  return files;
}

}  // namespace

std::optional<RenderedScenes> ReadKeptScenes(const fs::path& folder,
                                             const VirtualSensorOptions& options) try {
  const json of = ProgramAndKey(options);
  if (of.is_null()) return std::nullopt;
  const fs::path file = FileFor(folder, of);
  std::error_code ignored;
  if (!fs::exists(file, ignored)) return std::nullopt;
  const json kept = ParseBoundedJson(ReadTextFile(file, kMaxBytes));
  if (kept.at("of") != of) return std::nullopt;
  RenderedScenes scenes;
  scenes.names = kept.at("names").get<std::vector<std::string>>();
  scenes.caches = FilesFromJson(kept.at("sweeps"), folder);
  scenes.at_rest = FilesFromJson(kept.at("at_rest"), folder);
  scenes.second_at_rest = FilesFromJson(kept.at("second_at_rest"), folder);
  scenes.camera_file = kept.at("camera_file");
  scenes.second_camera_file = kept.at("second_camera_file");
  return scenes;
} catch (const std::exception&) {
  return std::nullopt;
}

void KeepScenes(const fs::path& folder, const VirtualSensorOptions& options,
                const RenderedScenes& scenes) noexcept try {
  const json of = ProgramAndKey(options);
  if (of.is_null()) return;
  const fs::path file = FileFor(folder, of);
  fs::path beside = file;
  beside += fmt::format("{}{}", kPartialMark, ::getpid());
  WriteWholeFile(beside, json{{"of", of},
                              {"names", scenes.names},
                              {"sweeps", FilesToJson(scenes.caches)},
                              {"at_rest", FilesToJson(scenes.at_rest)},
                              {"second_at_rest", FilesToJson(scenes.second_at_rest)},
                              {"camera_file", scenes.camera_file},
                              {"second_camera_file", scenes.second_camera_file}}
                             .dump());
  fs::rename(beside, file);
} catch (const std::exception&) {
  // They are found out again.
}

}  // namespace plumb::simulated
