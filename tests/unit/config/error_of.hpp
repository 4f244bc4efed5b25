// SPDX-License-Identifier: Apache-2.0
// What is said about a configuration.
#pragma once

#include <string>

#include "algo/base/errors.hpp"
#include "daemon/config/config.hpp"

namespace plumb::testing {

inline std::string ErrorOf(const std::string& text) {
  try {
    (void)ParseConfig(text, "test.toml");
  } catch (const DataError& error) {
    return error.what();
  }
  return "no error";
}

}  // namespace plumb::testing
