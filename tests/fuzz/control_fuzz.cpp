// SPDX-License-Identifier: Apache-2.0
// Any line at the control socket; what is understood must read back the same.
#include "daemon/control/control_protocol.hpp"

#include <cstdlib>

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One([&] {
    const plumb::ControlRequest request = plumb::ParseControlRequest(plumb::fuzz::Text(data, size));
    if (plumb::ParseControlRequest(plumb::ControlRequestText(request)) != request) std::abort();
  });
}
