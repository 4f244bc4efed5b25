// SPDX-License-Identifier: Apache-2.0
// Whether two sets of planning files are of the same patient, without keeping who that is.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace plumb {

inline constexpr std::size_t kPatientKeyBytes = 32;
/// A random one.
[[nodiscard]] std::string MakePatientKey();

/// Keyed hash of a Patient ID, with a mark of the key; spaces around the ID do not count, as in
/// DICOM. Without the key, IDs of few digits cannot be found by trying them all.
/// @param key  Of kPatientKeyBytes.
/// @return  Empty if there is no ID, or no such key.
[[nodiscard]] std::string PatientHash(std::string_view key, std::string_view patient_id);

enum class SamePatient {
  kSame,
  kOther,
  kUnknown,  ///< One of them is empty, or they were made with different keys.
};
[[nodiscard]] SamePatient ComparePatientHashes(std::string_view a, std::string_view b);

}  // namespace plumb
