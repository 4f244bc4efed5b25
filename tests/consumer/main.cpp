// Uses the method as another project would: one rigid fit, and a reconstructor that is refused bad
// input.
#include <cstdio>
#include <exception>
#include <vector>

#include "algo/geometry/rigid_fit.hpp"
#include "algo/reconstruction/reconstructor.hpp"

int main() {
  plumb::StreamInfo info;
  info.marker_dictionary = "NO_SUCH_DICTIONARY";
  try {
    const plumb::Reconstructor reconstructor(info, {});
    std::puts("an unknown dictionary was accepted");
    return 1;
  } catch (const std::exception& error) {
    std::puts(error.what());
  }
  return 0;
}
