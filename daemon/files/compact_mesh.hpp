// Compact encoding of a scan's surface, for the 3-D view of a browser on a slow network.
#pragma once

#include <string>

#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Vertices and triangles, without normals and colours, in a fraction of the size of the PLY file.
///
/// Format, all little-endian: "PLM2"; the numbers of vertices and triangles, 32 bits each; the
/// least x, y and z and the size of a step, 32-bit floats in metres; then a zlib stream. It
/// contains the x of all vertices, then the y, then the z, in steps above the least, as 16-bit
/// differences from the previous vertex (for the first from 0, modulo 2^16); then the corners of
/// the triangles as differences from the previous corner (for the first from 0), each as a zigzag
/// number (0, -1, 1, -2 are 0, 1, 2, 3) in groups of 7 bits, the lowest first, with bit 7 set in
/// all but the last.
///
/// The largest extent is 65535 steps: a body of 2 m has steps of 0.03 mm. Takes up to a second.
/// @throws std::invalid_argument for a triangle with a missing vertex; DataError for more than 2^25
///         vertices or triangles, which a browser refuses.
[[nodiscard]] std::string CompactMesh(const TriangleMesh& mesh);

}  // namespace plumb
