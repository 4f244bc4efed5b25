// SPDX-License-Identifier: Apache-2.0
// The parent's side of the programs of the package plumb-dicom, the only ones with DCMTK.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "drivers/files/reader_process.hpp"

namespace plumb {

/// One of these programs at work. The destructor ends it. Not thread-safe.
class DicomProgram {
 public:
  /// @param name  Such as "plumb-dicom-reader".
  /// @throws IoError if this installation does not have it, or it cannot be started.
  DicomProgram(const std::string& name, std::vector<std::string> arguments);

  /// Reads exactly so many bytes of what it says.
  /// @throws DataError if it ends before that, crashes, or is silent for too long.
  void Read(void* data, std::size_t size);

 private:
  ReaderProcess process_;
};

}  // namespace plumb
