// SPDX-License-Identifier: Apache-2.0
// What plumb-dicom-reader says to its parent: facts as JSON, the contours' points
// or an image's pixels as numbers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/dicom/planning_content.hpp"

namespace plumb {

/// Stands before each answer.
struct PlanningHeader {
  static constexpr std::uint32_t kMagic = 0x31434450;  // "PDC1"
  std::uint32_t magic = kMagic;
  std::uint32_t is_error = 0;     ///< 1: the text is that of ReaderErrorText().
  std::uint64_t text_bytes = 0;   ///< JSON.
  std::uint64_t num_numbers = 0;  ///< Three for each point, in the order of the contours;
                                  ///< one for each pixel.
};
inline constexpr std::size_t kMostFactBytes = std::size_t{32} << 20;

[[nodiscard]] std::string FactsOf(const PlanningContent& content);
[[nodiscard]] std::vector<double> PointsOf(const PlanningContent& content);

/// The other way round.
/// @throws DataError for what is no such answer: nothing of it is believed unchecked.
[[nodiscard]] PlanningContent ParsePlanning(std::string_view facts, std::span<const double> points);

}  // namespace plumb
