// Writes what an open sensor sees into an .oni file.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "drivers/openni/oni_file.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Records from its making until Finish(): once it is made, no image is missed. Images go from the
/// driver to the file through a thread of OpenNI2 that holds back what the disk does not take at
/// once, so none is lost. The sensor must outlive it and may be read at the same time. One thread
/// calls.
class OniRecorder {
 public:
  struct Options {
    bool jpeg = false;  ///< Colour as JPEG: a quarter of the size, but errors of up to a hundred
                        ///< grey levels at edges.
  };
  /// @param sensor  Of an OpenNiProvider.  @param file  A new file, in a folder that exists.
  /// @throws DeviceError, IoError; std::invalid_argument if the sensor is of another kind.
  OniRecorder(LiveSensor& sensor, std::filesystem::path file, const Options& options);
  /// Without Finish() the file is removed.
  ~OniRecorder();
  OniRecorder(const OniRecorder&) = delete;
  OniRecorder& operator=(const OniRecorder&) = delete;

  /// Waits for what is held back, trims the file and writes its side-car. @throws IoError
  /// @param begin  Stamps of the first images, where they are known; otherwise they are found by
  /// what the sensor gave meanwhile.
  OniFileSummary Finish(const std::optional<OniBegin>& begin = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
