#include "drivers/replay/tum_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <stop_token>
#include <thread>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"
#include "drivers/replay/camera_file.hpp"
#include "drivers/replay/depth_camera_search.hpp"
#include "drivers/replay/registration.hpp"
#include "drivers/replay/tum_index.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr double kMaxGapPeriods = 0.55;
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
};

/// A decoded frame, or the error that prevented it.
struct Decoded {
  Frame frame;
  std::exception_ptr error;
};

std::vector<IndexEntry> ReadIndex(const fs::path& file) {
  std::vector<IndexEntry> entries = ParseIndex(ReadTextFile(file, kMaxIndexBytes), file.string());
  if (entries.empty()) throw DataError(fmt::format("{} lists no image", file.string()));
  return entries;
}

/// Typical time from one image to the next; 0 if there is only one.
double MedianPeriod(const std::vector<IndexEntry>& entries) {
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < entries.size(); ++i)
    periods_s.push_back(entries[i].time_s - entries[i - 1].time_s);
  if (periods_s.empty()) return 0.0;
  return TakeMedian(periods_s);
}

/// The real path of an image, which must be inside the recording's folder even through links.
fs::path Resolve(const fs::path& canonical_folder, const fs::path& index, const IndexEntry& entry) {
  std::error_code error;
  fs::path file = fs::canonical(canonical_folder / entry.file, error);
  if (error) {
    throw DataError(
        fmt::format("image {} of {} (stamp {:.6f}) cannot be found: {}; copy the recording again "
                    "or remove the line",
                    entry.file, index.string(), entry.time_s, error.message()));
  }
  if (std::mismatch(canonical_folder.begin(), canonical_folder.end(), file.begin(), file.end())
          .first != canonical_folder.end()) {
    throw DataError(fmt::format(
        "image {} of {} is outside the recording's folder, at {}; copy it into the folder",
        entry.file, index.string(), file.string()));
  }
  return file;
}

/// TUM's published nominal camera, for recordings without calibration.
CameraFile AssumedCamera(const fs::path& first_image) {
  const cv::Mat image = ReadColorImage(first_image);
  if (image.cols * 3 != image.rows * 4) {
    throw DataError(
        fmt::format("the recording has no camera.yaml and its images are {}x{}: nominal intrinsics "
                    "are known only for 4:3 "
                    "(640x480, 320x240); add camera.yaml",
                    image.cols, image.rows));
  }
  CameraFile camera;
  camera.color = Resized(Intrinsics{}, image.cols, image.rows);
  camera.warnings.push_back(fmt::format(
      "no camera.yaml: assumed fx {} fy {} cx {} cy {}, no distortion and {} depth units per metre",
      camera.color.fx, camera.color.fy, camera.color.cx, camera.color.cy, camera.depth_scale));
  return camera;
}

cv::Mat ToMetres(const cv::Mat& depth_units, double units_per_metre) {
  cv::Mat depth_m;
  depth_units.convertTo(depth_m, CV_32F, 1.0 / units_per_metre);
  depth_m.setTo(0.0F, depth_units == kSaturated);
  return depth_m;
}

void CheckImageSize(const fs::path& file, const cv::Mat& image, const Intrinsics& camera,
                    const char* what) {
  if (image.cols == camera.width && image.rows == camera.height) return;
  throw DataError(
      fmt::format("{} image {} has {}x{} pixels, expected {}x{} as the camera states; use the "
                  "calibration of this image size",
                  what, file.string(), image.cols, image.rows, camera.width, camera.height));
}

class TumRecording : public FrameSource {
 public:
  TumRecording(const fs::path& folder, const RecordingDefaults& defaults);
  [[nodiscard]] const StreamInfo& info() const override { return info_; }
  [[nodiscard]] std::optional<Frame> Next() override;

 private:
  void FindFrames(const fs::path& folder, double least_max_gap_s);
  void ReadCamera(const fs::path& folder, const RecordingDefaults& defaults);
  void SearchDepthCamera();
  [[nodiscard]] Decoded Decode(std::size_t i) const;
  void DecodeAll(const std::stop_token& stop);

  StreamInfo info_;
  std::vector<FramePlan> plans_;
  double depth_scale_ = 5000.0;
  Intrinsics depth_intrinsics_;
  std::optional<DepthRegistration> registration_;

  // Shared with the decoding thread.
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Decoded> queue_;
  bool finished_ = false;  ///< The thread will not add more frames.
  std::jthread thread_;    ///< Last member: joined before the others are destroyed.
};

void TumRecording::FindFrames(const fs::path& folder, double least_max_gap_s) {
  const fs::path color_index = folder / "rgb.txt";
  const fs::path depth_index = folder / "depth.txt";
  const std::vector<IndexEntry> color = ReadIndex(color_index);
  const std::vector<IndexEntry> depth = ReadIndex(depth_index);
  // The nearest partner is at most half a period away; a tenth of that is added for jitter.
  const double max_gap_s = std::max(
      least_max_gap_s, kMaxGapPeriods * std::max(MedianPeriod(color), MedianPeriod(depth)));
  const std::vector<IndexPair> pairs = AssociateByTime(color, depth, max_gap_s);
  if (pairs.size() < kMinFrames) {
    throw DataError(
        fmt::format("recording {} has {} frame{} ({} colour and {} depth images, stamps at most "
                    "{:.0f} ms apart), expected at "
                    "least {}; are both lists of the same sweep and clock?",
                    folder.string(), pairs.size(), pairs.size() == 1 ? "" : "s", color.size(),
                    depth.size(), max_gap_s * 1e3, kMinFrames));
  }
  const fs::path canonical_folder = fs::canonical(folder);
  plans_.reserve(pairs.size());
  for (const IndexPair& pair : pairs) {
    const IndexEntry& c = color[pair.color];
    const IndexEntry& d = depth[pair.depth];
    plans_.push_back({Resolve(canonical_folder, color_index, c),
                      Resolve(canonical_folder, depth_index, d), c.time_s, d.time_s});
  }
  const auto num_unmatched_color = std::ssize(color) - std::ssize(pairs);
  const auto num_unmatched_depth = std::ssize(depth) - std::ssize(pairs);
  if (num_unmatched_color > 0 || num_unmatched_depth > 0) {
    info_.warnings.push_back(fmt::format(
        "{} of {} colour and {} of {} depth images have no partner within {:.0f} ms "
        "and are left out",
        num_unmatched_color, color.size(), num_unmatched_depth, depth.size(), max_gap_s * 1e3));
  }
  info_.num_frames = std::ssize(plans_);
}

void TumRecording::ReadCamera(const fs::path& folder, const RecordingDefaults& defaults) {
  const fs::path file = folder / "camera.yaml";
  const bool given = fs::exists(fs::symlink_status(file));
  const CameraFile camera =
      given ? ParseCameraFile(ReadTextFile(file, kMaxCameraBytes), file.string())
            : AssumedCamera(plans_.front().color_file);
  info_.intrinsics_assumed = !given;
  info_.marker_dictionary = defaults.marker_dictionary;
  info_.marker_length_m = defaults.marker_length_m;
  info_.reference_marker = defaults.reference_marker;
  TakeOver(camera, info_);
  if (!camera.marker_dictionary || !camera.marker_length_m) {
    info_.warnings.push_back(
        fmt::format("the recording does not state its markers: assumed {} with a side of {} m",
                    info_.marker_dictionary, info_.marker_length_m));
  }
  depth_scale_ = camera.depth_scale;
  depth_intrinsics_ = camera.depth_camera ? camera.depth_camera->intrinsics : camera.color;
  if (camera.depth_camera)
    registration_.emplace(depth_intrinsics_, camera.color, camera.depth_camera->T_color_depth);
  if (camera.depth_camera_unknown) SearchDepthCamera();
}

void TumRecording::SearchDepthCamera() {
  std::vector<ImagePair> pairs;
  const std::size_t every = plans_.size() / kSearchedPairs + 1;
  for (std::size_t i = 0; i < plans_.size(); i += every) {
    const Frame frame = Decode(i).frame;
    pairs.push_back({frame.color_rgb, frame.depth_m});
  }
  const std::optional<FoundDepthCamera> found = FindDepthCamera(pairs, info_.intrinsics);
  if (!found) return;
  const DepthCamera& depth = found->camera;
  registration_.emplace(depth.intrinsics, info_.intrinsics, depth.T_color_depth);
  info_.warnings.push_back(fmt::format(
      "edges of the depth images lie on those of the colour images if they are from a camera of "
      "focal length {:.0f} px, {:.0f} mm beside the colour camera: depth is registered with that "
      "estimate; state depth_camera_matrix, depth_distortion_coefficients and T_color_depth in "
      "camera.yaml to be exact",
      depth.intrinsics.fx, 1e3 * depth.T_color_depth.translation().x()));
}

Decoded TumRecording::Decode(std::size_t i) const {
  const FramePlan& plan = plans_[i];
  Decoded decoded;
  decoded.frame.index = static_cast<std::int64_t>(i);
  decoded.frame.color_time_s = plan.color_time_s;
  decoded.frame.depth_time_s = plan.depth_time_s;
  decoded.frame.color_rgb = ReadColorImage(plan.color_file);
  CheckImageSize(plan.color_file, decoded.frame.color_rgb, info_.intrinsics, "colour");
  const cv::Mat depth_units = ReadDepthImage(plan.depth_file);
  CheckImageSize(plan.depth_file, depth_units, depth_intrinsics_, "depth");
  decoded.frame.depth_m = ToMetres(depth_units, depth_scale_);
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

TumRecording::TumRecording(const fs::path& folder, const RecordingDefaults& defaults) {
  try {
    FindFrames(folder, defaults.max_stamp_gap_s);
    ReadCamera(folder, defaults);
  } catch (const fs::filesystem_error& failure) {
    throw DataError(
        fmt::format("recording {} cannot be read: {}", folder.string(), failure.what()));
  }
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

}  // namespace

std::unique_ptr<FrameSource> OpenTumRecording(const fs::path& folder,
                                              const RecordingDefaults& defaults) {
  if (!(defaults.max_stamp_gap_s > 0 && defaults.marker_length_m > 0 &&
        MarkerDictionary::Find(defaults.marker_dictionary))) {
    throw std::invalid_argument("RecordingDefaults: gap, marker length or dictionary out of range");
  }
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    throw DataError(fmt::format("recording {} is {}; expected a folder with rgb.txt and depth.txt",
                                folder.string(),
                                fs::exists(folder, error) ? "no folder" : "missing"));
  }
  return std::make_unique<TumRecording>(folder, defaults);
}

bool IsTumRecording(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "rgb.txt", ignored) || fs::exists(folder / "depth.txt", ignored);
}

}  // namespace plumb
