// SPDX-License-Identifier: Apache-2.0
// Any text as scene.json and as sensitivity.json.
#include "daemon/files/sensitivity_json.hpp"
#include "daemon/files/stored_scene.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto text = plumb::fuzz::Text(data, size);
  plumb::fuzz::One([&] { (void)plumb::ParseSensitivityJson(text, "fuzz"); });
  return plumb::fuzz::One([&] { (void)plumb::ParseSceneJson(text, "fuzz"); });
}
