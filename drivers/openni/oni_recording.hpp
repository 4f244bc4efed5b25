// An .oni recording as a stream of frames.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "algo/types/frame.hpp"
#include "drivers/replay/tum_recording.hpp"

namespace plumb {

/// Streams an .oni file, every pair, in order, as fast as it is read. The file is opened by a child
/// process (plumb-oni-reader), because OpenNI2 crashes or hangs on damaged files: that is a
/// DataError here. Depth is taken as registered to colour. One thread calls.
class OniRecording : public FrameSource {
 public:
  /// Calibration and markers come from the side-car (see oni_file.hpp); without one: nominal
  /// intrinsics, the defaults and warnings.
  /// @throws DataError if the file is missing, damaged or holds no pairs that Plumb can use;
  /// IoError if the child cannot be started.
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
