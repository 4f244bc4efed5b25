// Directions in a stored result: where the patient's sides are, and the names of the six numbers.
#pragma once

#include <array>
#include <optional>
#include <string>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "web/service/result_terms.hpp"

namespace plumb {

/// A direction in `body` of result.json as a unit vector in the plane of the reference marker;
/// nothing if it is missing or not a direction.
[[nodiscard]] std::optional<Eigen::Vector2d> WayIn(const nlohmann::json& body, const char* name);

/// Names of the six numbers, in the order of the results. If the room was not known, the numbers
/// run along the axes of the reference marker. Each is then named after the patient's axis that
/// lies along it, in agreement with the words of its direction, or else after the marker's axis;
/// never after one of the couch. The page has the same rule in numbers.js.
/// @param result  result.json, or anything else if it cannot be read: then the couch's names.
[[nodiscard]] std::array<std::string, 6> AxisNames(const nlohmann::json& result,
                                                   const web::ResultTerms& terms);

}  // namespace plumb
