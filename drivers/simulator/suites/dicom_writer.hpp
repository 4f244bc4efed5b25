// SPDX-License-Identifier: Apache-2.0
// Writes structure sets, plans and CT images as DICOM files, independently of the library that
// reads them.
#pragma once

#include <string>

#include "algo/types/ct_image.hpp"
#include "algo/types/treatment_plan.hpp"

namespace plumb {

/// The bytes of a file with explicit lengths, little-endian. Contour data of more than 65534 bytes
/// stand as UN, as CP-1066 asks for. Empty texts and values that are not stated are left out.
[[nodiscard]] std::string DicomBytes(const StructureSet& structures);
[[nodiscard]] std::string DicomBytes(const TreatmentPlan& plan);
[[nodiscard]] std::string DicomBytes(const CtImage& image);

}  // namespace plumb
