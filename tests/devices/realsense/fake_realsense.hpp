// SPDX-License-Identifier: Apache-2.0
// A library with librealsense2's C interface, whose cameras the tests plug in, and whose images
// they make. A test is linked with it, and its file is given to the driver, which loads it: both
// get the same one.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "drivers/realsense/realsense_api.hpp"

namespace plumb::fake_realsense {

struct FakeMode {
  int stream = 0, format = 0;
  int rate_hz = 30;
  realsense::RsIntrinsics camera;
};

struct FakeUnit {
  std::string name = "Intel RealSense D435", serial = "728612070259";
  std::string firmware = "5.16.0.1", advised_firmware = "5.16.0.1", usb = "3.2", line = "D400";
  /// Of the stereo module and of the colour camera; without the second, the first has them all.
  std::vector<FakeMode> depth_modes, color_modes;
  realsense::RsExtrinsics depth_to_color{.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                         .translation = {}};
  float depth_unit_m = 0.001F;
  bool busy = false;  ///< Its streams do not start.
};

struct FakeImage {
  int stream = 0, format = 0;
  int width = 0, height = 0, stride = 0;
  const void* data = nullptr;
  std::uint64_t number = 0;
  double timestamp_ms = 0.0;
  int timestamp_domain = realsense::kDomainHardwareClock;
  std::map<int, std::int64_t> metadata;
};

/// As if it had been in the port before the library started, if nothing listens; else the library
/// tells of it.
void Attach(FakeUnit unit);
void Detach(const std::string& serial);
/// Calls back with the image, on this thread. False if nobody has started that stream.
bool Deliver(const std::string& serial, const FakeImage& image);
/// The value that an option was set to; nothing was set: -1.
[[nodiscard]] float OptionOf(const std::string& serial, int stream, int option);
/// As major * 10000 + minor * 100 + patch.
void SetVersion(int version);
/// Objects and images that were given out and not released.
[[nodiscard]] int NumAlive();
/// Detaches all.
void Reset();

}  // namespace plumb::fake_realsense
