// SPDX-License-Identifier: Apache-2.0
// Any bytes as an .oni file, and as the file beside it.
#include <algorithm>

#include "drivers/openni/oni_file.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One([&] {
    (void)plumb::SummariseOniFile([&](std::uint64_t offset, std::span<std::uint8_t> bytes) {
      if (offset > size || bytes.size() > size - offset) return false;
      std::copy_n(data + offset, bytes.size(), bytes.begin());
      return true;
    });
    (void)plumb::ParseOniBegin(plumb::fuzz::Text(data, size));
  });
}
