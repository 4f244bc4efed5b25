// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_recording.hpp"

#include <algorithm>
#include <array>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/replay/camera_file.hpp"
#include "drivers/replay/depth_camera_search.hpp"
#include "drivers/replay/foreign_calibration.hpp"
#include "drivers/replay/registration.hpp"
#include "drivers/replay/tum_index.hpp"
#include "words/foreign.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxIndexBytes = std::size_t{64} << 20;
constexpr std::size_t kMaxCameraBytes = std::size_t{1} << 16;
constexpr std::size_t kReadAhead = 3;
constexpr std::size_t kMinFrames = 2;
constexpr std::uint16_t kSaturated = 65535;
constexpr std::size_t kSearchedPairs = 24;  // For a depth camera that the recording does not state.

/// Names and stamps of one pair, as needed for decoding.
struct FramePlan {
  fs::path color_file;
  fs::path depth_file;
  double color_time_s = 0.0;
  double depth_time_s = 0.0;
  bool fewer_keypoints = false;
};

/// A decoded frame, or the error that prevented it.
struct Decoded {
  Frame frame;
  std::exception_ptr error;
};

/// Names of what lies in the folder and is no recording of Plumb, but of another program.
std::vector<std::string> ForeignNames(const fs::path& folder) {
  constexpr std::array kNames = {
      "associations.txt",      "color",          "depth",           "rgb",
      "camera_intrinsic.json", "intrinsic.json", "transforms.json", "camera_matrix.csv",
      "odometry.csv",          "metadata"};
  constexpr std::array kEndings = {".bag",  ".mcap",      ".mkv",       ".db3", ".db", ".r3d",
                                   ".sens", ".color.png", ".color.jpg", ".klg", ".oni"};
  std::vector<std::string> found;
  std::error_code ignored;
  for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored)) {
    const std::string name = entry->path().filename().string();
    if (std::ranges::find(kNames, name) != kNames.end() ||
        std::ranges::any_of(kEndings, [&](const char* e) { return name.ends_with(e); }))
      found.push_back(name);
  }
  std::ranges::sort(found);  // Some are enough to know what it is.
  if (found.size() > 4) found.resize(4);
  return found;
}

std::vector<IndexEntry> ReadIndex(const fs::path& file) {
  std::error_code ignored;
  if (!fs::exists(file, ignored)) {
    std::vector<std::string> names = ForeignNames(file.parent_path());
    if (!names.empty())
      throw DataError(say::recording::ListMissing(file.string(), std::move(names)));
  }
  std::vector<IndexEntry> entries = ParseIndex(ReadTextFile(file, kMaxIndexBytes), file.string());
  if (entries.empty()) throw DataError(say::recording::NoImages(file.string()));
  return entries;
}

/// Refuses stamps that cannot be seconds of a sweep, and warns of those that hardly can.
void CheckPeriod(double period_s, const fs::path& list, std::vector<Message>& warnings) {
  // Sensors deliver 5 to 90 images a second.
  constexpr double kLeast_s = 0.001, kSlow_s = 0.5, kMost_s = 5.0;
  if (period_s <= 0) return;
  if (period_s < kLeast_s || period_s > kMost_s)
    throw DataError(say::recording::StampsNotSeconds(list.string(), period_s));
  if (period_s > kSlow_s) warnings.push_back(say::recording::StampsSlow(list.string(), period_s));
}

/// Names of files that may hold the calibration under another name.
std::vector<std::string> CalibrationLikeNames(const fs::path& folder) {
  std::vector<std::string> found;
  std::error_code ignored;
  for (fs::directory_iterator entry(folder, ignored), end; entry != end; entry.increment(ignored)) {
    const std::string name = entry->path().filename().string();
    const auto ends = [&](const char* ending) { return name.ends_with(ending); };
    if (ends(".yaml") || ends(".yml") || ends(".xml") || ends(".json") || ends(".toml") ||
        (ends(".txt") &&
         (name.find("camera") != std::string::npos || name.find("calib") != std::string::npos ||
          name.find("intrinsic") != std::string::npos)))
      found.push_back(name);
  }
  std::ranges::sort(found);
  return found;
}

/// Units per metre from the images themselves, where nothing states them: the two units in use
/// differ by five, and a sensor that is held by hand looks at things 0.3 to 4 m away.
double DepthUnitsByMedian(const std::vector<fs::path>& images) {
  std::vector<double> values;
  for (const fs::path& image : images) {
    const cv::Mat units = ReadDepthImage(image);
    for (int r = 4; r < units.rows; r += 8)
      for (int c = 4; c < units.cols; c += 8)
        if (const std::uint16_t z = units.at<std::uint16_t>(r, c); z > 0 && z != kSaturated)
          values.push_back(z);
  }
  constexpr double kMillimetres = 1000.0, kTum = 5000.0, kFarthest_m = 4.0;
  return !values.empty() && TakeMedian(values) > kFarthest_m * kMillimetres ? kTum : kMillimetres;
}

/// The real path of an image, which must be inside the recording's folder even through links.
fs::path Resolve(const fs::path& canonical_folder, const fs::path& index, const IndexEntry& entry) {
  std::error_code error;
  fs::path file = fs::canonical(canonical_folder / entry.file, error);
  if (error) {
    throw DataError(
        say::recording::ImageMissing(entry.file, index.string(), entry.time_s, error.message()));
  }
  if (std::mismatch(canonical_folder.begin(), canonical_folder.end(), file.begin(), file.end())
          .first != canonical_folder.end()) {
    throw DataError(say::recording::ImageOutside(entry.file, index.string(), file.string()));
  }
  return file;
}

/// TUM's published nominal camera, for recordings without calibration.
CameraFile AssumedCamera(const fs::path& folder, int width, int height) {
  if (width * 3 != height * 4) throw DataError(say::recording::NoNominalCamera(width, height));
  CameraFile camera;
  camera.color = Resized(Intrinsics{}, width, height);
  camera.warnings.push_back(say::recording::CameraAssumed(camera.color.fx, camera.color.fy,
                                                          camera.color.cx, camera.color.cy));
  if (std::vector<std::string> names = CalibrationLikeNames(folder); !names.empty())
    camera.warnings.push_back(say::recording::CameraOtherName(std::move(names)));
  return camera;
}

void CheckImageSize(const fs::path& file, const cv::Mat& image, const Intrinsics& camera,
                    const Message& what) {
  if (image.cols == camera.width && image.rows == camera.height) return;
  throw DataError(say::recording::ImageSize(what, file.string(), image.cols, image.rows,
                                            camera.width, camera.height));
}

class TumRecording : public TumSource {
 public:
  TumRecording(const fs::path& folder, const RecordingDefaults& defaults);
  TumRecording(const ImageFolder& contents, const RecordingDefaults& defaults);
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] const CameraFile& camera() const override { return camera_; }
  [[nodiscard]] std::optional<Frame> Next() override;

 private:
  void FindFrames(const ImageFolder& contents, double least_max_gap_s);
  void ReadCamera(const fs::path& folder, const RecordingDefaults& defaults);
  void SetCamera(CameraFile camera, const RecordingDefaults& defaults);
  void TakeDepthUnit(const RecordingDefaults& defaults);
  void SearchDepthCamera();
  void CheckDepthSize(const fs::path& file, const cv::Mat& depth) const;
  [[nodiscard]] Decoded Decode(std::size_t i) const;
  void DecodeAll(const std::stop_token& stop);

  StreamInfo info_;
  CameraFile camera_;  ///< With the unit and the depth camera that were taken.
  std::vector<FramePlan> plans_;
  bool depth_is_exr_ = false;
  std::function<void(const fs::path&, cv::Mat&)> filter_depth_;
  std::optional<DepthRegistration> registration_;

  // Shared with the decoding thread.
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Decoded> queue_;
  bool finished_ = false;  ///< The thread will not add more frames.
  std::jthread thread_;    ///< Last member: joined before the others are destroyed.
};

void TumRecording::FindFrames(const ImageFolder& contents, double least_max_gap_s) {
  const fs::path& folder = contents.folder;
  const std::vector<IndexEntry>& color = contents.color;
  const std::vector<IndexEntry>& depth = contents.depth;
  CheckPeriod(MedianPeriod(color), contents.color_list, info_.warnings);
  CheckPeriod(MedianPeriod(depth), contents.depth_list, info_.warnings);
  const double max_gap_s = LargestGap(color, depth, least_max_gap_s);
  const std::vector<IndexPair> pairs = AssociateByTime(color, depth, max_gap_s);
  if (pairs.size() < kMinFrames) {
    throw DataError(say::recording::FewFrames(folder.string(), pairs.size(), color.size(),
                                              depth.size(), max_gap_s * 1e3, kMinFrames));
  }
  const fs::path canonical_folder = fs::canonical(folder);
  plans_.reserve(pairs.size());
  for (const IndexPair& pair : pairs) {
    const IndexEntry& c = color[pair.color];
    const IndexEntry& d = depth[pair.depth];
    plans_.push_back(
        {Resolve(canonical_folder, contents.color_list, c),
         Resolve(canonical_folder, contents.depth_list, d), c.time_s, d.time_s,
         std::ranges::binary_search(contents.fewer_keypoints, d.time_s, {}, &IndexEntry::time_s)});
  }
  const auto num_unmatched_color = std::ssize(color) - std::ssize(pairs);
  const auto num_unmatched_depth = std::ssize(depth) - std::ssize(pairs);
  if (num_unmatched_color > 0 || num_unmatched_depth > 0) {
    info_.warnings.push_back(say::recording::Unpaired(
        num_unmatched_color, color.size(), num_unmatched_depth, depth.size(), max_gap_s * 1e3));
  }
  info_.num_frames = std::ssize(plans_);
}

void TumRecording::ReadCamera(const fs::path& folder, const RecordingDefaults& defaults) {
  const fs::path file = folder / "camera.yaml";
  if (fs::exists(fs::symlink_status(file)))
    return SetCamera(ParseCameraFile(ReadTextFile(file, kMaxCameraBytes), file.string()), defaults);
  const cv::Mat image = ReadColorImage(plans_.front().color_file);
  const cv::Mat depth = ReadDepthImage(plans_.front().depth_file);
  if (auto found = FindForeignCalibration(folder, image.size(), depth.size())) {
    if (found->depth_file.empty())
      info_.warnings.push_back(say::foreign::CalibrationUsed(found->file, found->camera.color.fx));
    return SetCamera(std::move(found->camera), defaults);
  }
  info_.intrinsics_assumed = true;
  SetCamera(AssumedCamera(folder, image.cols, image.rows), defaults);
}

void TumRecording::SetCamera(CameraFile camera, const RecordingDefaults& defaults) {
  camera_ = std::move(camera);
  info_.room_markers = defaults.room_markers;
  TakeOver(camera_, info_);
  info_.dictionary_assumed = !camera_.room_markers.dictionary;
  info_.marker_length_assumed = !camera_.room_markers.length_m;
  if (info_.dictionary_assumed || info_.marker_length_assumed) {
    info_.warnings.push_back(
        say::recording::MarkersAssumed(info_.room_markers.dictionary, info_.room_markers.length_m));
  }
  if (!camera_.depth_scale) TakeDepthUnit(defaults);
  info_.depth_units_per_metre = *camera_.depth_scale;
  if (const std::optional<DepthCamera>& depth = camera_.depth_camera)
    registration_.emplace(depth->intrinsics, camera_.color, depth->T_color_depth);
  if (camera_.depth_camera_unknown) SearchDepthCamera();
}

void TumRecording::TakeDepthUnit(const RecordingDefaults& defaults) {
  info_.depth_unit_assumed = info_.depth_unit_open = true;
  if (defaults.depth_scale) {
    camera_.depth_scale = defaults.depth_scale;
    info_.warnings.push_back(say::recording::DepthScaleByMarkers(*camera_.depth_scale));
    return;
  }
  std::vector<fs::path> images;
  for (std::size_t i = 0; i < plans_.size(); i += plans_.size() / kSearchedPairs + 1)
    images.push_back(plans_[i].depth_file);
  camera_.depth_scale = DepthUnitsByMedian(images);
  info_.warnings.push_back(say::recording::DepthScaleAssumed(*camera_.depth_scale));
}

void TumRecording::SearchDepthCamera() {
  std::vector<ImagePair> pairs;
  const std::size_t every = plans_.size() / kSearchedPairs + 1;
  for (std::size_t i = 0; i < plans_.size(); i += every) {
    const Frame frame = Decode(i).frame;
    pairs.push_back({frame.color_rgb, frame.depth_m});
  }
  const std::optional<FoundDepthCamera> found = FindDepthCamera(pairs, info_.intrinsics);
  camera_.depth_camera_unknown = info_.depth_camera_unknown = !found;
  if (!found) return;
  info_.depth_camera_estimated = true;
  const DepthCamera& depth = camera_.depth_camera.emplace(found->camera);
  registration_.emplace(depth.intrinsics, info_.intrinsics, depth.T_color_depth);
  info_.warnings.push_back(say::recording::DepthCameraFound(
      depth.intrinsics.fx, 1e3 * depth.T_color_depth.translation().x()));
}

/// Depth of a camera that is not stated can be searched for only on the colour image's pixels.
void TumRecording::CheckDepthSize(const fs::path& file, const cv::Mat& depth) const {
  const Intrinsics& color = camera_.color;
  if (camera_.depth_camera_unknown && (depth.cols != color.width || depth.rows != color.height))
    throw DataError(say::recording::DepthCameraOfSize(file.string(), depth.cols, depth.rows,
                                                      color.width, color.height));
  CheckImageSize(file, depth, camera_.depth_camera ? camera_.depth_camera->intrinsics : color,
                 say::recording::Depth());
}

Decoded TumRecording::Decode(std::size_t i) const {
  const FramePlan& plan = plans_[i];
  Decoded decoded;
  decoded.frame.index = static_cast<std::int64_t>(i);
  decoded.frame.color_time_s = plan.color_time_s;
  decoded.frame.depth_time_s = plan.depth_time_s;
  decoded.frame.fewer_keypoints = plan.fewer_keypoints;
  decoded.frame.color_rgb = ReadColorImage(plan.color_file);
  CheckImageSize(plan.color_file, decoded.frame.color_rgb, info_.intrinsics,
                 say::recording::Colour());
  cv::Mat depth = depth_is_exr_ ? ReadExrDepth(plan.depth_file) : ReadDepthImage(plan.depth_file);
  CheckDepthSize(plan.depth_file, depth);
  if (filter_depth_) filter_depth_(plan.depth_file, depth);
  decoded.frame.depth_m = depth_is_exr_ ? depth : DepthInMetres(depth, *camera_.depth_scale);
  if (registration_) decoded.frame.depth_m = registration_->Register(decoded.frame.depth_m);
  return decoded;
}

void TumRecording::DecodeAll(const std::stop_token& stop) {
  for (std::size_t i = 0; i < plans_.size(); ++i) {
    Decoded decoded;
    try {
      decoded = Decode(i);
    } catch (...) {
      decoded.error = std::current_exception();
    }
    const bool failed = decoded.error != nullptr;
    std::unique_lock lock(mutex_);
    if (!changed_.wait(lock, stop, [this] { return queue_.size() < kReadAhead; })) return;
    queue_.push_back(std::move(decoded));
    finished_ = failed || i + 1 == plans_.size();
    lock.unlock();
    changed_.notify_all();
    if (failed) return;
  }
}

/// The contents of a folder in TUM's layout, without its camera.
ImageFolder TumContents(const fs::path& folder) {
  ImageFolder contents;
  contents.folder = folder;
  contents.color_list = folder / "rgb.txt";
  contents.depth_list = folder / "depth.txt";
  contents.color = ReadIndex(contents.color_list);
  contents.depth = ReadIndex(contents.depth_list);
  const fs::path fewer = folder / kFewerKeypointsFile;
  if (fs::exists(fs::symlink_status(fewer))) contents.fewer_keypoints = ReadIndex(fewer);
  return contents;
}

TumRecording::TumRecording(const fs::path& folder, const RecordingDefaults& defaults) try {
  FindFrames(TumContents(folder), defaults.max_stamp_gap_s);
  ReadCamera(folder, defaults);
} catch (const fs::filesystem_error& failure) {
  throw DataError(say::recording::Unreadable(folder.string(), failure.what()));
}

TumRecording::TumRecording(const ImageFolder& contents, const RecordingDefaults& defaults) try {
  info_.warnings = contents.warnings;
  info_.intrinsics_assumed = contents.intrinsics_assumed;
  depth_is_exr_ = contents.depth_is_exr;
  filter_depth_ = contents.filter_depth;
  FindFrames(contents, defaults.max_stamp_gap_s);
  SetCamera(contents.camera, defaults);
} catch (const fs::filesystem_error& failure) {
  throw DataError(say::recording::Unreadable(contents.folder.string(), failure.what()));
}

std::optional<Frame> TumRecording::Next() {
  if (!thread_.joinable())
    thread_ = std::jthread([this](const std::stop_token& stop) { DecodeAll(stop); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !queue_.empty() || finished_; });
  if (queue_.empty()) return std::nullopt;
  Decoded decoded = std::move(queue_.front());
  queue_.pop_front();
  lock.unlock();
  changed_.notify_all();
  if (decoded.error) std::rethrow_exception(decoded.error);
  return std::move(decoded.frame);
}

void CheckDefaults(const RecordingDefaults& defaults) {
  if (defaults.depth_scale && !(*defaults.depth_scale > 0))
    throw std::invalid_argument("RecordingDefaults: depth_scale must be positive");
  if (!(defaults.max_stamp_gap_s > 0 && defaults.room_markers.length_m > 0 &&
        MarkerDictionary::Find(defaults.room_markers.dictionary))) {
    throw std::invalid_argument("RecordingDefaults: gap, marker length or dictionary out of range");
  }
}

}  // namespace

std::unique_ptr<TumSource> OpenTumRecording(const fs::path& folder,
                                            const RecordingDefaults& defaults) {
  CheckDefaults(defaults);
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw DataError(fs::exists(folder, error) ? say::recording::NoFolder(folder.string())
                                              : say::recording::Missing(folder.string()));
  }
  return std::make_unique<TumRecording>(folder, defaults);
}

std::unique_ptr<TumSource> OpenImageFolder(ImageFolder contents,
                                           const RecordingDefaults& defaults) {
  CheckDefaults(defaults);
  return std::make_unique<TumRecording>(contents, defaults);
}

bool IsTumRecording(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "rgb.txt", ignored) || fs::exists(folder / "depth.txt", ignored);
}

}  // namespace plumb
