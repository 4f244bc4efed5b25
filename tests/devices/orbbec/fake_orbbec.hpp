// SPDX-License-Identifier: Apache-2.0
// A library with OrbbecSDK's C interface, whose cameras the tests plug in, and whose images they
// make. A test is linked with it, and its file is given to the driver, which loads it: both get the
// same one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "drivers/orbbec/orbbec_api.hpp"

namespace plumb::fake_orbbec {

struct FakeMode {
  int format = 0;
  std::uint32_t rate_hz = 30;
  orbbec::ObIntrinsics camera;
  orbbec::ObDistortion lens;
};

struct FakeCamera {
  std::string name = "Orbbec Gemini 335", serial = "CP0E8420001A";
  std::string firmware = "1.8.10", port = "USB3.2";
  int type = 1;  ///< Binocular.
  std::vector<FakeMode> depth_modes, color_modes;
  orbbec::ObExtrinsics depth_to_color{.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}, .translation = {}};
  orbbec::ObRange exposure{.current = 156, .most = 330, .least = 1, .step = 1, .usual = 156};
  bool busy = false;  ///< Its streams do not start.
};

struct FakeImage {
  bool is_depth = false;
  int format = 0;
  std::uint32_t width = 0, height = 0, bytes = 0;
  void* data = nullptr;
  std::uint64_t number = 0, stamp_us = 0;
  float scale_mm = 1.0F;
};

/// As if it had been in the port before the library started, if nothing listens; else the library
/// tells of it.
void Attach(FakeCamera camera);
void Detach(const std::string& serial);
/// Calls back with the image, on this thread. False if nobody has started that stream.
bool Deliver(const std::string& serial, const FakeImage& image);
/// The value that a property was set to; nothing was set: -1.
[[nodiscard]] int PropertyOf(const std::string& serial, int property);
/// As major * 10000 + minor * 100 + patch.
void SetVersion(int version);
/// Objects and images that were given out and not released.
[[nodiscard]] int NumAlive();
/// Detaches all.
void Reset();

}  // namespace plumb::fake_orbbec
