// Streams a recording in the TUM RGB-D layout: a folder with rgb.txt, depth.txt, their images and
// usually camera.yaml.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "algo/types/frame.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// Defaults for everything that a recording does not state.
struct RecordingDefaults {
  std::string marker_dictionary = kDefaultMarkerDictionary;
  double marker_length_m = kDefaultMarkerLength_m;
  std::optional<int> reference_marker;
  /// Largest difference between the stamps of a colour image and its depth image; 0.55 periods of
  /// the slower stream, if that is more, so that streams of a low rate that are half a period apart
  /// still pair.
  double max_stamp_gap_s = 0.020;
};

/// Streams a recording. A separate thread decodes up to three frames ahead, in order, so that
/// decoding overlaps the work on the frames; the result does not depend on timing. Next() and
/// info() must be called from one thread.
///
/// Depth of 65535 units also means "nothing measured" (saturated). Depth that is not registered is
/// registered here, see DepthRegistration.
///
/// Opening reads the index and camera.yaml and finds every image, without decoding any (except the
/// first colour image if camera.yaml is missing; TUM's published intrinsics are then assumed,
/// scaled to its size). Next() throws DataError for an image that is damaged or of another size
/// than the camera; no frames follow.
/// @throws DataError if anything is missing, damaged or contradictory, or there are fewer than two
///         frames.
/// @throws std::invalid_argument if the defaults are invalid.
[[nodiscard]] std::unique_ptr<FrameSource> OpenTumRecording(const std::filesystem::path& folder,
                                                            const RecordingDefaults& defaults = {});

/// True if the folder looks like a recording: it contains rgb.txt or depth.txt.
[[nodiscard]] bool IsTumRecording(const std::filesystem::path& folder);

}  // namespace plumb
