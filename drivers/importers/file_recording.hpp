// SPDX-License-Identifier: Apache-2.0
// A recording of another program as a stream of frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "algo/types/frame.hpp"
#include "drivers/replay/camera_file.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {

/// What was recognised of a recording of another program.
struct ImportedFacts {
  std::string format;  ///< Such as "RealSense .bag".
  std::string name = {}, serial = {},
              firmware = {};     ///< Of the sensor; empty where nothing states it.
  std::string calibration = {};  ///< Where the camera is from.
  CameraFile camera = {};        ///< With the depth camera as the recording states it.
  std::optional<double> stereo_baseline_m = {};
  std::int64_t color_images = 0;
  std::vector<double> depth_s = {};  ///< Stamps of the depth images.
};

/// Frames of another program's recording. Depth that is not registered is registered here. Next()
/// throws DataError for damaged images, and from the first frame on if the recording lacks what a
/// scan needs: two pairs, the unit of the depth, the depth camera.
class ImportedRecording : public FrameSource {
 public:
  [[nodiscard]] virtual const ImportedFacts& facts() const = 0;
};

/// Opens a file whose format Plumb reads itself, in a child process (plumb-file-reader). A file
/// `FILE.yaml` beside it, with the keys of camera.yaml, states the camera instead of the recording.
/// @throws DataError if it is damaged or of no such format; IoError if the child cannot be started.
[[nodiscard]] std::unique_ptr<ImportedRecording> OpenFileRecording(
    const std::filesystem::path& file, const RecordingDefaults& defaults = {});

/// True for a regular file that begins like one of those formats.
[[nodiscard]] bool IsFileRecording(const std::filesystem::path& file);

}  // namespace plumb
