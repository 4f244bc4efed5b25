// SPDX-License-Identifier: Apache-2.0
// An .oni recording as a stream of frames.
#pragma once

#include <filesystem>
#include <memory>

#include "algo/types/frame.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {

/// Streams an .oni file: every pair, in order, as fast as it is read. The file is opened by a child
/// process (plumb-oni-reader), because OpenNI2 crashes or hangs on damaged files, which is a
/// DataError here. Depth is assumed to be registered to colour. Not thread-safe.
///
/// Calibration and markers are read from the side-car (see oni_file.hpp). Without one, nominal
/// intrinsics and the defaults are used, with warnings.
/// @throws DataError if the file is missing, damaged or has no usable pairs; IoError if the child
///         cannot be started.
[[nodiscard]] std::unique_ptr<FrameSource> OpenOniRecording(const std::filesystem::path& file,
                                                            const RecordingDefaults& defaults = {});

}  // namespace plumb
