// Any text as scene.json.
#include "daemon/files/scene_json.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return plumb::fuzz::One(
      [&] { (void)plumb::ParseSceneJson(plumb::fuzz::Text(data, size), "fuzz"); });
}
