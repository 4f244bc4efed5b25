// Writes a deformation field as a binary little-endian PLY file.
#pragma once

#include <filesystem>

#include "algo/comparison/deformation.hpp"

namespace plumb {

/// One vertex per sample: float x y z (reference frame, metres), float dx dy dz (the displacement
/// that remains after the rigid correction, metres), uchar observed (0: no correspondence in the
/// current scan).
/// @throws IoError
void WriteDeformationPly(const std::filesystem::path& path, const Deformation& deformation);

}  // namespace plumb
