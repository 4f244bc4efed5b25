// SPDX-License-Identifier: Apache-2.0
// What plumbd and the command line read beside recordings and scenes. The first byte chooses the
// reader: configuration, region, sensor profile, stored result.
#include <string>

#include "daemon/config/config.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/files/sensor_profile_file.hpp"
#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string text(plumb::fuzz::Text(data + 1, size - 1));
  return plumb::fuzz::One([&] {
    switch (data[0] % 5) {
      case 0:
        return void(plumb::ParseConfig(text, "fuzz", plumb::ConfigUse::kAppliance));
      case 1:
        return void(plumb::ParseConfig(text, "fuzz"));
      case 2:
        return void(plumb::ParseRegion(text, "fuzz"));
      case 3:
        return void(plumb::ParseSensorProfile(text));
      default:
        return void(plumb::SummaryOf(text));
    }
  });
}
