// SPDX-License-Identifier: Apache-2.0
// Any bytes as a binary recording of another program: bags of ROS 1 and 2, Azure .mkv,
// ScanNet .sens.
#include <algorithm>

#include "drivers/importers/open_recorded_file.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One([&] {
    const auto file = plumb::OpenRecordedFile(
        {.size = size, .read = [&](std::uint64_t offset, std::span<std::uint8_t> bytes) {
           if (offset > size || bytes.size() > size - offset) return false;
           std::copy_n(data + offset, bytes.size(), bytes.begin());
           return true;
         }});
    for (std::size_t i = 0; i < file->facts().color_s.size(); ++i) (void)file->Color(i);
    for (std::size_t i = 0; i < file->facts().depth_s.size(); ++i) (void)file->Depth(i);
  });
}
