// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/phone_folder.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/importers/folder_recording.hpp"
#include "drivers/importers/phone_metadata.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxMetadata = std::size_t{64} << 20;  // An hour at 60 Hz has 40 MB.
constexpr double kPhoneUnitsPerMetre = 1000.0;
constexpr int kSureConfidence = 2;  // ARKit: 0 low, 1 medium, 2 high.
constexpr std::size_t kSampledMaps = 24;
// Of the focal length: a smaller one has no effect that a sweep shows.
constexpr double kLeastFocalSpread = 0.001;

struct FoundPhone {
  std::string format, file;  ///< Whose folder it is, and what states the camera.
  fs::path folder;           ///< That of the images.
  PhoneMetadata metadata;
};

bool HasFile(const fs::path& file) {
  std::error_code error;
  return fs::is_regular_file(file, error);
}

std::optional<FoundPhone> FindPhone(const fs::path& given) {
  for (const fs::path& folder : {given, given / "EXR_RGBD"})
    if (const fs::path file = folder / "metadata.json"; HasFile(file))
      if (auto metadata = ParseRecord3d(ReadTextFile(file, kMaxMetadata), file.string()))
        return FoundPhone{"Record3D", "metadata.json", folder, std::move(*metadata)};
  const fs::path matrix = given / "camera_matrix.csv", odometry = given / "odometry.csv";
  if (!HasFile(matrix) || !HasFile(odometry)) return std::nullopt;
  return FoundPhone{
      "Stray Scanner", "camera_matrix.csv", given,
      ParseStray(ReadTextFile(matrix, kMaxMetadata), ReadTextFile(odometry, kMaxMetadata))};
}

bool HasEnding(const fs::path& folder, const char* ending) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; entry != end; entry.increment(error))
    if (EndsLike(entry->path().filename().string(), ending)) return true;
  return false;
}

/// The images, or the command that makes some that can be read.
std::pair<Numbered, Numbered> PhoneImages(const fs::path& folder, const std::string& format,
                                          bool is_exr) {
  std::error_code error;
  const bool has_color = fs::is_directory(folder / "rgb", error);
  if (!has_color && HasFile(folder / "rgb.mp4"))
    throw DataError(say::foreign::NotReadYet(
        folder.string(), format + ", rgb.mp4",
        "mkdir rgb && ffmpeg -noautorotate -i rgb.mp4 -vsync 0 -start_number 0 -q:v 2 "
        "rgb/%06d.jpg"));
  return {NumberedImages(folder, "rgb", {}, false),
          NumberedImages(folder, "depth", is_exr ? ".exr" : "", true)};
}

/// The camera for images of these sizes.
CameraFile PhoneCamera(const FoundPhone& phone, const cv::Mat& color, const cv::Mat& depth) {
  const PhoneMetadata& stated = phone.metadata;
  const int width = stated.width > 0 ? stated.width : color.cols;
  const int height = stated.height > 0 ? stated.height : color.rows;
  const std::string name = (phone.folder / phone.file).string();
  const nlohmann::ordered_json keys = {
      {"image_width", width},
      {"image_height", height},
      {"camera_matrix", {stated.fx, 0.0, stated.cx, 0.0, stated.fy, stated.cy, 0.0, 0.0, 1.0}},
      {"distortion_coefficients", {0, 0, 0, 0, 0}},
      {"depth_scale", kPhoneUnitsPerMetre}};
  CameraFile camera = ParseCameraFile(keys.dump(), name);
  // Depth is of the colour camera's view, to a pixel.
  for (const cv::Mat* image : {&color, &depth})
    if (std::abs(image->cols * height - image->rows * width) > std::max(width, height))
      throw DataError(say::foreign::OtherShape(name, width, height, image->cols, image->rows));
  camera.color = Resized(camera.color, color.cols, color.rows);
  camera.depth_camera = DepthCamera{.intrinsics = Resized(camera.color, depth.cols, depth.rows)};
  camera.depth_sensor = stated.sensor;
  return camera;
}

/// Pairs by number, with the stamp of that number.
void ListPairs(const FoundPhone& phone, const Numbered& color, const Numbered& depth,
               double rate_hz, ImageFolder& contents) {
  const std::vector<double>& stamps_s = phone.metadata.stamps_s;
  std::int64_t unpaired = 0;
  for (const auto& [number, file] : color) {
    const auto partner = depth.find(number);
    const bool is_stamped =
        stamps_s.empty() || (number >= 0 && number < std::ssize(stamps_s) &&
                             !std::isnan(stamps_s[static_cast<std::size_t>(number)]));
    if (partner == depth.end() || !is_stamped) {
      ++unpaired;
      continue;
    }
    const double time_s = stamps_s.empty() ? static_cast<double>(number) / rate_hz
                                           : stamps_s[static_cast<std::size_t>(number)];
    contents.color.push_back({time_s, file});
    contents.depth.push_back({time_s, partner->second});
  }
  unpaired += std::ssize(depth) - std::ssize(contents.depth);
  if (contents.color.empty()) throw DataError(say::foreign::NoSameNumber(phone.folder.string()));
  if (unpaired > 0) contents.warnings.push_back(say::foreign::NumbersUnpaired(unpaired));
}

/// The map of how sure the phone is of a depth image; it has the same number.
fs::path ConfidenceOf(const fs::path& folder, const fs::path& depth) {
  return folder / "confidence" / (depth.stem().string() + ".png");
}

/// 255 where the phone is not sure of the depth. The map may be of another size.
cv::Mat UnsureDepth(const cv::Mat& map, cv::Size size) {
  cv::Mat unsure(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y)
    for (int x = 0; x < size.width; ++x)
      unsure.at<std::uint8_t>(y, x) =
          map.at<cv::Vec3b>(y * map.rows / size.height, x * map.cols / size.width)[0] <
                  kSureConfidence
              ? 255
              : 0;
  return unsure;
}

/// Leaves out depth of which the phone itself is not sure, where its app wrote a map of that.
void LeaveOutUnsureDepth(ImageFolder& contents) {
  const fs::path folder = contents.folder;
  std::error_code error;
  if (!fs::is_directory(folder / "confidence", error)) return;
  std::int64_t num_without = 0, num_pixels = 0, num_unsure = 0;
  double most = 0;
  const std::size_t every = contents.depth.size() / kSampledMaps + 1;
  for (std::size_t i = 0; i < contents.depth.size(); ++i) {
    const fs::path file = ConfidenceOf(folder, contents.depth[i].file);
    if (!HasFile(file)) {
      ++num_without;
    } else if (i % every == 0) {
      const cv::Mat map = ReadColorImage(file);
      double least_of_map = 0, most_of_map = 0;
      cv::minMaxIdx(map, &least_of_map, &most_of_map);
      most = std::max(most, most_of_map);
      num_pixels += static_cast<std::int64_t>(map.total());
      num_unsure += cv::countNonZero(UnsureDepth(map, map.size()));
    }
  }
  if (num_pixels == 0) return;
  if (!(most >= 1 && most <= kSureConfidence)) {
    contents.warnings.push_back(say::foreign::ConfidenceUnknown((folder / "confidence").string(),
                                                                static_cast<std::int64_t>(most)));
    return;
  }
  contents.filter_depth = [folder](const fs::path& file, cv::Mat& depth) {
    if (const fs::path map = ConfidenceOf(folder, file); HasFile(map))
      depth.setTo(0, UnsureDepth(ReadColorImage(map), depth.size()));
  };
  if (num_unsure > 0)
    contents.warnings.push_back(say::foreign::UnsureDepth(100.0 * static_cast<double>(num_unsure) /
                                                          static_cast<double>(num_pixels)));
  if (num_without > 0) contents.warnings.push_back(say::foreign::WithoutConfidence(num_without));
}

}  // namespace

bool IsPhoneFolder(const fs::path& folder) {
  std::error_code error;
  return fs::is_directory(folder, error) && FindPhone(folder).has_value();
}

std::unique_ptr<ImportedRecording> OpenPhoneFolder(const fs::path& folder,
                                                   const RecordingDefaults& defaults) {
  const std::optional<FoundPhone> phone = FindPhone(folder);
  if (!phone) throw DataError(say::foreign::NoCalibration(folder.string()));
  ImageFolder contents;
  contents.depth_is_exr =
      HasEnding(phone->folder / "depth", ".exr") && !HasEnding(phone->folder / "depth", ".png");
  const auto [color, depth] = PhoneImages(phone->folder, phone->format, contents.depth_is_exr);
  if (color.empty() || depth.empty())
    throw DataError(say::foreign::NoSameNumber(phone->folder.string()));
  contents.folder = phone->folder;
  contents.color_list = contents.depth_list = phone->folder / phone->file;
  constexpr double kUsualPhoneRate_hz = 60.0;
  const double rate_hz =
      defaults.rate_hz.value_or(phone->metadata.rate_hz.value_or(kUsualPhoneRate_hz));
  if (phone->metadata.stamps_s.empty())
    contents.warnings.push_back(say::foreign::RateAssumed(rate_hz));
  ListPairs(*phone, color, depth, rate_hz, contents);
  LeaveOutUnsureDepth(contents);
  if (const double spread = phone->metadata.focal_spread; spread > kLeastFocalSpread)
    contents.warnings.push_back(say::foreign::FocalChanges(100.0 * spread, phone->metadata.fx));
  const fs::path first_depth = phone->folder / depth.begin()->second;
  contents.camera =
      PhoneCamera(*phone, ReadColorImage(phone->folder / color.begin()->second),
                  contents.depth_is_exr ? ReadExrDepth(first_depth) : ReadDepthImage(first_depth));
  return OpenListedFolder(std::move(contents),
                          {.format = phone->format, .calibration = phone->file}, defaults);
}

}  // namespace plumb
