#include "daemon/appliance/result_directions.hpp"

#include <cmath>

namespace plumb {
namespace {

using Json = nlohmann::json;

// sin(22.5 deg): the comparison chooses one of eight directions.
constexpr double kNear = 0.38268343236508977;

std::string_view NameAlong(Eigen::Index marker_axis, const Json& body,
                           const web::AxisTerms& terms) {
  const auto is_near = [&](const char* name) {
    const std::optional<Eigen::Vector2d> way = WayIn(body, name);
    return way && std::abs((*way)[marker_axis]) > kNear;
  };
  const bool is_head = is_near("head_xy"), is_left = is_near("left_xy");
  if (is_head == is_left) return marker_axis == 0 ? terms.marker_x : terms.marker_y;
  return is_head ? terms.head : terms.left;
}

}  // namespace

std::optional<Eigen::Vector2d> WayIn(const Json& body, const char* name) {
  const auto found = body.find(name);
  if (found == body.end() || !found->is_array() || found->size() != 2) return std::nullopt;
  if (!(*found)[0].is_number() || !(*found)[1].is_number()) return std::nullopt;
  const Eigen::Vector2d way((*found)[0].get<double>(), (*found)[1].get<double>());
  if (!way.allFinite() || way.norm() < 1e-6) return std::nullopt;
  return way.normalized();
}

std::array<std::string, 6> AxisNames(const Json& result, const web::ResultTerms& terms) {
  std::array<std::string, 6> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = terms.axes[i];
  const Json body = result.is_object() ? result.value("body", Json()) : Json();
  if (!body.is_object() || body.value("room_known", true)) return names;
  constexpr std::size_t kLongitudinal = 1, kLateral = 2, kPitch = 3, kRoll = 4;
  constexpr Eigen::Index kX = 0, kY = 1;
  names[kLongitudinal] = NameAlong(kY, body, terms.lines);
  names[kLateral] = NameAlong(kX, body, terms.lines);
  names[kPitch] = NameAlong(kY, body, terms.tilts);
  names[kRoll] = NameAlong(kX, body, terms.tilts);
  return names;
}

}  // namespace plumb
