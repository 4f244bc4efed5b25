// SPDX-License-Identifier: Apache-2.0
// Any bytes as the first message of a program that delivers frames, as a calibration of
// another program, and as what apps of phones state; the first byte chooses the reader.
#include <string>

#include "drivers/importers/phone_metadata.hpp"
#include "drivers/replay/foreign_calibration.hpp"
#include "drivers/stream/stream_protocol.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view text = plumb::fuzz::Text(data + 1, size - 1);
  return plumb::fuzz::One([&] {
    constexpr const char* kNames[] = {"camera.json", "camera.yaml", "camera.txt"};
    if (data[0] < 3)
      (void)plumb::ParseForeignCalibration(text, kNames[data[0]], 640, 480);
    else if (data[0] == 5)
      (void)plumb::ParseRecord3d(text, "metadata.json");
    else if (data[0] == 6)
      (void)plumb::ParseStray(text, text);
    else
      (void)plumb::stream::ParseHello(text, data[0] == 4);
  });
}
