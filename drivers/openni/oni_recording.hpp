// An .oni recording as a stream of frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "algo/types/frame.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {

/// Streams an .oni file: every pair, in order, as fast as it is read. The file is opened by a child
/// process (plumb-oni-reader), because OpenNI2 crashes or hangs on damaged files, which is a
/// DataError here. Depth is assumed to be registered to colour. Not thread-safe.
class OniRecording : public FrameSource {
 public:
  /// Calibration and markers are read from the side-car (see oni_file.hpp). Without one, nominal
  /// intrinsics and the defaults are used, with warnings.
  /// @throws DataError if the file is missing, damaged or has no usable pairs; IoError if the child
  ///         cannot be started.
  [[nodiscard]] static std::unique_ptr<OniRecording> Open(const std::filesystem::path& file,
                                                          const RecordingDefaults& defaults = {});
  ~OniRecording() override;

  [[nodiscard]] const StreamInfo& info() const override;
  [[nodiscard]] std::optional<Frame> Next() override;

 private:
  struct Impl;
  explicit OniRecording(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
