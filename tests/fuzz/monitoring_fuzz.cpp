// SPDX-License-Identifier: Apache-2.0
// Any bytes as a record of live monitoring.
#include "daemon/monitoring_files/monitoring_file.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One([&] {
    (void)plumb::ParseMonitoring({reinterpret_cast<const char*>(data), size}, "fuzz");
  });
}
