// SPDX-License-Identifier: Apache-2.0
// Any bytes as a DICOM file, and what was read of it through the wire.
#include "drivers/dicom/dicom_objects.hpp"
#include "drivers/dicom/planning_wire.hpp"

#include "tests/fuzz/fuzz_one.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool prepared = (plumb::PrepareDicom(), true);
  (void)prepared;
  return plumb::fuzz::One([&] {
    const plumb::PlanningContent content = plumb::ReadDicom({data, size});
    (void)plumb::ParsePlanning(plumb::FactsOf(content), plumb::PointsOf(content));
  });
}
