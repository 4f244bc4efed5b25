// SPDX-License-Identifier: Apache-2.0
// The key for PatientHash(), in the state folder; no backup has it, so that nobody finds the
// Patient IDs of one.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/planning/patient_hash.hpp"
#include "daemon/unit/page_identity.hpp"

namespace plumb {

/// Made at the first call. @throws DataError, IoError as ReadOrMakeSecret()
[[nodiscard]] inline std::string PatientKey(const std::filesystem::path& state) {
  return ReadOrMakeSecret(state / "patient.key", MakePatientKey);
}

}  // namespace plumb
