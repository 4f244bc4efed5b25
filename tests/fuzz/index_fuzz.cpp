// SPDX-License-Identifier: Apache-2.0
// Any text as an index; where it is one, it is paired with itself, which must find every image.
#include <cstdlib>

#include "drivers/replay/tum_index.hpp"
#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One([&] {
    const std::vector<plumb::IndexEntry> entries =
        plumb::ParseIndex(plumb::fuzz::Text(data, size), "fuzz");
    constexpr double kGap_s = 0.02;
    if (plumb::AssociateByTime(entries, entries, kGap_s).size() != entries.size()) std::abort();
  });
}
