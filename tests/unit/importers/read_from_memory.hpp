// SPDX-License-Identifier: Apache-2.0
// Recordings of other programs that a test has written into memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "drivers/importers/open_recorded_file.hpp"

namespace plumb::testing {

/// @param bytes  Borrowed.
inline FileBytes InMemory(const std::vector<std::uint8_t>& bytes) {
  return {.size = bytes.size(), .read = [&bytes](std::uint64_t offset, std::span<std::uint8_t> to) {
            if (offset > bytes.size() || to.size() > bytes.size() - offset) return false;
            std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), to.size(), to.begin());
            return true;
          }};
}

/// Reads every image. Whether the file or one of them was refused, which takes a reason.
inline bool IsRefused(const std::vector<std::uint8_t>& bytes) {
  try {
    const auto file = OpenRecordedFile(InMemory(bytes));
    for (std::size_t k = 0; k < file->facts().color_s.size(); ++k) (void)file->Color(k);
    for (std::size_t k = 0; k < file->facts().depth_s.size(); ++k) (void)file->Depth(k);
  } catch (const DataError& error) {
    EXPECT_STRNE(error.what(), "");
    return true;
  }
  return false;
}

}  // namespace plumb::testing
