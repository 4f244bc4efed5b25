// SPDX-License-Identifier: Apache-2.0
// Any bytes as a depth image of OpenEXR.
#include "drivers/files/image_file.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One([&] { (void)plumb::DecodeExrDepth({data, size}, "fuzz"); });
}
