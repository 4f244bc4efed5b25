#include <cstdio>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"

namespace plumb {

void PrintOut(const std::string& text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0) {
    throw IoError("cannot write to the standard output: it is closed or its disk is full");
  }
}

}  // namespace plumb
