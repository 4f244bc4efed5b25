// SPDX-License-Identifier: Apache-2.0
// Any bytes as a PLY, cloud and mesh.
#include "daemon/files/ply_file.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  plumb::fuzz::One([&] { (void)plumb::ParseCloudPly({data, size}, "fuzz"); });
  return plumb::fuzz::One([&] { (void)plumb::ParseMeshPly({data, size}, "fuzz"); });
}
