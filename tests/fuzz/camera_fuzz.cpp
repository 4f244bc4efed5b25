// SPDX-License-Identifier: Apache-2.0
// Any text as camera.yaml.
#include "drivers/replay/camera_file.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One(
      [&] { (void)plumb::ParseCameraFile(plumb::fuzz::Text(data, size), "fuzz"); });
}
