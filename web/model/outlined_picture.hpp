// SPDX-License-Identifier: Apache-2.0
// The camera's picture, and where the reference would be seen in it.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace plumb {

struct CameraOutline {
  std::string jpeg;
  std::string reference;  ///< Its id: the session may have another one by the time it is shown.
  /// Points as shares of the picture's width and height; a line that is no ring ends at the
  /// picture's border.
  std::vector<std::vector<std::pair<float, float>>> lines;
  bool is_placed = false;  ///< Whether the markers in the picture say where the camera is.
};

}  // namespace plumb
