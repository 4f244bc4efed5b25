// SPDX-License-Identifier: Apache-2.0
// Patient orientation, and its names in files and in the interface.
#pragma once

#include <cstdint>

#include "algo/base/names.hpp"

namespace plumb {

/// Which end points to the gantry and which side is up.
enum class PatientPosture : std::uint8_t {
  kHeadFirstSupine,
  kHeadFirstProne,
  kFeetFirstSupine,
  kFeetFirstProne
};
template <>
inline constexpr auto kNamesOf<PatientPosture> =
    NamesUpTo<PatientPosture::kFeetFirstProne>({"HFS", "HFP", "FFS", "FFP"});

}  // namespace plumb
