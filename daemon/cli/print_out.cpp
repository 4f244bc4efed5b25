// SPDX-License-Identifier: Apache-2.0
#include <cstdio>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "words/cli.hpp"

namespace plumb {

void PrintOut(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw IoError(say::cli::OutputClosed());
  }
}

}  // namespace plumb
