// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/image_folder.hpp"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <string_view>
#include <utility>

#include <opencv2/core/mat.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/folder_recording.hpp"
#include "drivers/importers/recorded_file.hpp"
#include "drivers/replay/foreign_calibration.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxCameraFile = std::size_t{1} << 16;
constexpr double kUsualRate_hz = 30.0;
constexpr std::array kColorFolders = {"color", "colour", "rgb", "image", "images"};

/// Where the images are, relative to the recording's folder.
struct Layout {
  std::string format;
  std::string color, depth;                     ///< Folders; empty: the recording's own.
  std::string_view color_ending, depth_ending;  ///< Empty: any image.
};

/// The time that a name states: seconds with decimals, or a whole number of milliseconds,
/// microseconds or nanoseconds since 1970, recognised by its number of digits. Other text may
/// precede it ("rgb_12.345"); a short number with decimals then needs a separator before it,
/// because the 1.0002 of "cam1.0002" is not a time.
std::optional<double> StampOf(std::string_view stem) {
  constexpr std::size_t kDigitsSince1970 = 9;
  if (const std::size_t before = stem.find_last_not_of("0123456789."); before != stem.npos) {
    const bool is_set_off = std::string_view("_- ").find(stem[before]) != std::string_view::npos;
    stem.remove_prefix(before + 1);
    const std::size_t point = stem.find('.');
    if (point != stem.npos && !is_set_off && point < kDigitsSince1970) return std::nullopt;
  }
  if (stem.empty() || stem.front() == '.') return std::nullopt;
  const std::optional<double> value = ParseNumber<double>(stem);
  if (!value || stem.find('.') != std::string_view::npos) return value;
  constexpr std::array<std::pair<std::size_t, double>, 3> kUnits = {
      {{13, 1e-3}, {16, 1e-6}, {19, 1e-9}}};
  for (const auto& [digits, unit_s] : kUnits)
    if (stem.size() == digits) return *value * unit_s;
  return std::nullopt;
}

/// The images of a folder by the stamps in their names; empty unless every name has one.
std::vector<IndexEntry> StampedIn(const fs::path& folder, const std::string& sub, bool is_depth) {
  std::vector<IndexEntry> images;
  std::error_code error;
  for (fs::directory_iterator entry(folder / sub, error), end; entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!IsImageName(name, {}, is_depth)) continue;
    const std::optional<double> time_s = StampOf(entry->path().stem().string());
    if (!time_s || images.size() >= kMostRecordedImages) return {};
    images.push_back({*time_s, sub + "/" + name});
  }
  std::ranges::sort(images, {}, &IndexEntry::time_s);
  const auto same = [](const IndexEntry& a, const IndexEntry& b) { return a.time_s == b.time_s; };
  if (std::ranges::adjacent_find(images, same) != images.end()) return {};
  return images;
}

bool HasImages(const fs::path& folder, const Layout& layout) {
  const auto has = [&](const std::string& sub, std::string_view ending, bool is_depth) {
    std::error_code error;
    for (fs::directory_iterator entry(folder / sub, error), end; entry != end;
         entry.increment(error))
      if (IsImageName(entry->path().filename().string(), ending, is_depth)) return true;
    return false;
  };
  return has(layout.color, layout.color_ending, false) &&
         has(layout.depth, layout.depth_ending, true);
}

std::optional<Layout> LayoutOf(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) return std::nullopt;
  for (const char* color : kColorFolders) {
    const Layout layout{"folder of images", color, "depth", {}, {}};
    if (HasImages(folder, layout)) return layout;
  }
  const Layout scenes{"7-Scenes", {}, {}, ".color.png", ".depth.png"};
  if (HasImages(folder, scenes)) return scenes;
  return std::nullopt;
}

/// 7-Scenes' camera, from its web page: the default of its Kinect for colour and depth alike.
CameraFile SevenScenesCamera() {
  CameraFile camera;
  camera.color = {.width = 640, .height = 480, .fx = 585, .fy = 585, .cx = 320, .cy = 240};
  camera.depth_scale = 1000.0;
  camera.depth_camera_unknown = true;
  camera.depth_sensor = DepthSensor::kStructuredLight;
  return camera;
}

/// The camera, what it is from, and the rate that its file states.
struct FoundCamera {
  CameraFile camera;
  std::string file;
  bool assumed = false;
  std::optional<double> rate_hz = {};
  std::string sensor_name = {}, serial = {};
};

FoundCamera CameraOf(const fs::path& folder, const Layout& layout, const std::string& first_color,
                     const std::string& first_depth) {
  if (const fs::path file = folder / "camera.yaml"; fs::exists(fs::symlink_status(file)))
    return {.camera = ParseCameraFile(ReadTextFile(file, kMaxCameraFile), file.string()),
            .file = "camera.yaml"};
  const cv::Size color = ReadColorImage(folder / first_color).size();
  const cv::Size depth = ReadDepthImage(folder / first_depth).size();
  // Some programs keep the calibration beside the images' folders, others among the colour images.
  for (const fs::path& place : {folder, folder / layout.color}) {
    if (auto found = FindForeignCalibration(place, color, depth))
      return {.camera = found->camera,
              .file = found->file,
              .rate_hz = found->rate_hz,
              .sensor_name = found->sensor_name,
              .serial = found->serial};
  }
  if (layout.color_ending.empty()) throw DataError(say::foreign::NoCalibration(folder.string()));
  return {.camera = SevenScenesCamera(), .file = layout.format, .assumed = true};
}

/// Adds the pairs of equal numbers, with stamps of a steady rate.
void AddPairs(const Numbered& color, const Numbered& depth, double rate_hz, ImageFolder& contents) {
  std::int64_t unpaired = 0;
  const std::int64_t first = std::min(color.begin()->first, depth.begin()->first);
  for (const auto& [number, file] : color) {
    const auto partner = depth.find(number);
    if (partner == depth.end()) {
      ++unpaired;
      continue;
    }
    const double time_s = static_cast<double>(number - first) / rate_hz;
    contents.color.push_back({time_s, file});
    contents.depth.push_back({time_s, partner->second});
  }
  unpaired += std::ssize(depth) - std::ssize(contents.depth);
  if (contents.color.empty()) throw DataError(say::foreign::NoSameNumber(contents.folder.string()));
  if (unpaired > 0) contents.warnings.push_back(say::foreign::NumbersUnpaired(unpaired));
  // Programs that begin at 0 and at 1 leave one image at either end without partner.
  const auto is_whole = [](const Numbered& images) {
    return images.rbegin()->first - images.begin()->first + 1 == std::ssize(images);
  };
  const std::int64_t first_color = color.begin()->first, first_depth = depth.begin()->first;
  if (color.size() == depth.size() && is_whole(color) && is_whole(depth) &&
      std::abs(first_color - first_depth) == 1)
    contents.warnings.push_back(say::foreign::NumbersShifted(first_color, first_depth));
}

/// Images that are numbered only, and their camera.
FoundCamera TakeNumbered(const fs::path& folder, const Layout& layout,
                         const RecordingDefaults& defaults, ImageFolder& contents) {
  const Numbered color = NumberedImages(folder, layout.color, layout.color_ending, false);
  const Numbered depth = NumberedImages(folder, layout.depth, layout.depth_ending, true);
  FoundCamera found = CameraOf(folder, layout, color.begin()->second, depth.begin()->second);
  const double rate_hz = defaults.rate_hz.value_or(found.rate_hz.value_or(kUsualRate_hz));
  contents.warnings.push_back(say::foreign::RateAssumed(rate_hz));
  contents.color.clear();
  contents.depth.clear();
  AddPairs(color, depth, rate_hz, contents);
  return found;
}

}  // namespace

bool IsImageFolder(const fs::path& folder) { return LayoutOf(folder).has_value(); }

std::unique_ptr<ImportedRecording> OpenImageFolderRecording(const fs::path& folder,
                                                            const RecordingDefaults& defaults) {
  const std::optional<Layout> layout = LayoutOf(folder);
  if (!layout) throw DataError(say::foreign::NoCalibration(folder.string()));
  ImageFolder contents;
  contents.folder = folder;
  contents.color_list = folder / layout->color;
  contents.depth_list = folder / layout->depth;
  if (!layout->color.empty()) {
    contents.color = StampedIn(folder, layout->color, false);
    contents.depth = StampedIn(folder, layout->depth, true);
  }
  const bool is_stamped = !contents.color.empty() && !contents.depth.empty();
  const FoundCamera found = is_stamped ? CameraOf(folder, *layout, contents.color.front().file,
                                                  contents.depth.front().file)
                                       : TakeNumbered(folder, *layout, defaults, contents);
  contents.camera = found.camera;
  contents.intrinsics_assumed = found.assumed;
  if (found.assumed) contents.warnings.push_back(say::foreign::PublishedCamera(layout->format));
  return OpenListedFolder(std::move(contents),
                          {.format = layout->format,
                           .name = found.sensor_name,
                           .serial = found.serial,
                           .calibration = found.file},
                          defaults);
}

}  // namespace plumb
