// SPDX-License-Identifier: Apache-2.0
// Any bytes as a PNG, read as colour and as depth. Check sums are set right first: a mutation would
// hardly ever pass them.
#include <zlib.h>

#include <vector>

#include "drivers/files/image_file.hpp"
#include "tests/fuzz/fuzz_one.hpp"

namespace {

std::uint32_t BigEndian(const std::uint8_t* at) {
  return std::uint32_t{at[0]} << 24 | std::uint32_t{at[1]} << 16 | std::uint32_t{at[2]} << 8 |
         std::uint32_t{at[3]};
}

void SetCheckSums(std::vector<std::uint8_t>& png) {
  constexpr std::size_t kSignature = 8;
  std::size_t at = kSignature;
  while (at + 12 <= png.size()) {
    const std::size_t length = BigEndian(png.data() + at);
    if (length > png.size() - at - 12) return;
    const auto sum =
        static_cast<std::uint32_t>(crc32(0, png.data() + at + 4, static_cast<uInt>(length + 4)));
    for (std::size_t i = 0; i < 4; ++i)
      png[at + 8 + length + i] = static_cast<std::uint8_t>(sum >> (24 - 8 * i));
    at += length + 12;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<std::uint8_t> png(data, data + size);
  SetCheckSums(png);
  plumb::fuzz::One([&] { (void)plumb::DecodeColorImage(png, "fuzz"); });
  return plumb::fuzz::One([&] { (void)plumb::DecodeDepthImage(png, "fuzz"); });
}
