// The field of a deformed body as a binary little-endian PLY.
#pragma once

#include <filesystem>

#include "algo/comparison/deformation.hpp"

namespace plumb {

/// One vertex a sample: float x y z (reference frame, metres), float dx dy dz (the displacement
/// that the rigid correction leaves, metres), uchar observed (0: no counterpart in the current
/// scan).
/// @throws IoError
void WriteDeformationPly(const std::filesystem::path& path, const Deformation& deformation);

}  // namespace plumb
