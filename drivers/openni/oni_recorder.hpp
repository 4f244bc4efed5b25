// SPDX-License-Identifier: Apache-2.0
// Records an open sensor into an .oni file.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "drivers/openni/oni_file.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Records from construction until Finish(): once it is constructed, no image is missed. Images
/// pass through a thread of OpenNI2 that buffers what the disk does not accept at once, so that
/// none is lost. The sensor must outlive it and may be read at the same time. Not thread-safe.
class OniRecorder {
 public:
  struct Options {
    /// Colour as JPEG: a quarter of the size, but with errors of up to a hundred grey levels at
    /// edges.
    bool jpeg = false;
  };
  /// @param sensor  Of an OpenNiProvider.  @param file  A new file, in a folder that exists.
  /// @throws DeviceError, IoError; std::invalid_argument if the sensor is of another kind.
  OniRecorder(LiveSensor& sensor, std::filesystem::path file, const Options& options);
  /// Without Finish() the file is removed.
  ~OniRecorder();
  OniRecorder(const OniRecorder&) = delete;
  OniRecorder& operator=(const OniRecorder&) = delete;

  /// Waits until buffered images are written, trims the file and writes its side-car.
  /// @throws IoError
  /// @param begin  Stamps of the first images, if known; otherwise they are found from the sensor's
  ///         stamps.
  OniFileSummary Finish(const std::optional<OniBegin>& begin = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
