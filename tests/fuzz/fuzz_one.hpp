// SPDX-License-Identifier: Apache-2.0
// What every fuzz target does with one input: the reader may refuse it with DataError; anything
// else is a finding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "algo/base/errors.hpp"

namespace plumb::fuzz {

template <typename Read>
int One(const Read& read) {
  try {
    read();
  } catch (const DataError&) {
  }
  return 0;
}

inline std::string_view Text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace plumb::fuzz
