// SPDX-License-Identifier: Apache-2.0
#include "daemon/result/axis_names.hpp"

#include <cmath>

#include "algo/verdict/shown_row.hpp"
#include "words/result.hpp"

namespace plumb {
namespace {

// sin(22.5 deg): the comparison chooses one of eight directions.
constexpr double kNear = 0.38268343236508977;

/// Names of numbers that run along the axes of the reference marker.
struct AxisTerms {
  Message (*head)(), (*left)();          ///< Along the patient's axes.
  Message (*marker_x)(), (*marker_y)();  ///< Where those are not known.
};
constexpr AxisTerms kLines{say::result::LineHead, say::result::LineLeft, say::result::LineMarkerX,
                           say::result::LineMarkerY};
constexpr AxisTerms kTilts{say::result::TiltHead, say::result::TiltLeft, say::result::TiltMarkerX,
                           say::result::TiltMarkerY};

Message NameAlong(Eigen::Index marker_axis, const StoredBody& body, const AxisTerms& terms) {
  const auto is_near = [&](const std::optional<Eigen::Vector2d>& way) {
    return way && std::abs((*way)[marker_axis]) > kNear;
  };
  const bool is_head = is_near(body.head_xy), is_left = is_near(body.left_xy);
  if (is_head == is_left) return marker_axis == 0 ? terms.marker_x() : terms.marker_y();
  return is_head ? terms.head() : terms.left();
}

}  // namespace

std::array<Message, 6> AxisNames(const std::optional<StoredBody>& body) {
  std::array<Message, 6> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = AxisName(i);
  if (!body || body->room_known) return names;
  constexpr std::size_t kLongitudinal = 1, kLateral = 2, kPitch = 3, kRoll = 4;
  constexpr Eigen::Index kX = 0, kY = 1;
  names[kLongitudinal] = NameAlong(kY, *body, kLines);
  names[kLateral] = NameAlong(kX, *body, kLines);
  names[kPitch] = NameAlong(kY, *body, kTilts);
  names[kRoll] = NameAlong(kX, *body, kTilts);
  return names;
}

}  // namespace plumb
