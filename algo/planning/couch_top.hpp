// SPDX-License-Identifier: Apache-2.0
// The couch in the contours that images of a CT give.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/planning/contour_surface.hpp"

namespace plumb {

/// Height of a flat couch that reaches out beside the body on one side or both: what is outermost
/// is level and at one height along the scan, which no flank of a body is. Nothing where the body
/// hides the couch, where it is curved like a cradle, or where there is none.
/// @param scan  One slice for each place (see Joined()), with points at most 6 mm apart.
[[nodiscard]] std::optional<double> CouchTop(const std::vector<ContourSlice>& scan);

/// A structure that a planning system drew beneath the body; a slice for each of its places.
struct DrawnSupport {
  std::string name;
  std::vector<ContourSlice> slices;
};

struct DrawnCouch {
  struct Part {
    std::string name;
    double top_m = 0.0;
  };
  std::vector<double> top_m;          ///< At each place of the scan; empty: none is the couch.
  std::vector<Part> parts;            ///< The structures whose tops these are.
  std::vector<std::string> not_used;  ///< Those that are taken for no couch.
};

/// Takes for the couch those structures whose top is at one height, that are there along a third of
/// the scan at least, and above which the body rises: not blocks, cushions and plates above it. At
/// each place the highest of those that are there counts, so that a board ends where it ends.
[[nodiscard]] DrawnCouch CouchAsDrawn(const std::vector<ContourSlice>& scan,
                                      const std::vector<DrawnSupport>& supports);

/// Draws everything up to a height flat, so that a body that touches the couch ends there, and
/// leaves out what has no inside then.
void RemoveBelow(double height_m, ContourSlice& slice);

}  // namespace plumb
