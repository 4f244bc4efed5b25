// The exceptions that cross module boundaries. Poor quality is never an exception; it is a field of
// a result.
#pragma once

#include <stdexcept>

namespace plumb {

/// Input data (a recording, a scene, a configuration) is missing, damaged or contradictory. The
/// message names what failed, on what, what was expected and found, and what to do. Exit code 3 on
/// the command line.
class DataError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The system refused one of our writes or reads (disk full, permission). Exit code 1.
class IoError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A sensor or another device failed. Exit code 5.
class DeviceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The device was unplugged while in use.
class DeviceLost : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

/// Work was stopped on request (Ctrl-C or cancel). Exit code 130.
class Interrupted : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace plumb
