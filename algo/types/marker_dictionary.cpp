// SPDX-License-Identifier: Apache-2.0
#include "algo/types/marker_dictionary.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <span>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/types/marker_codes.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

/// A family of markers. The smaller sets of one size are the first codes of the largest set.
struct Family {
  std::string_view name;
  int bits_per_side;
  int max_correction_bits;  ///< As in OpenCV; MIP: distance 12 leaves one nearest code.
  std::span<const std::uint64_t> codes;
};

/// The original ArUco family has no table: each row of five cells is one of four words, selected by
/// two bits of the id, the highest first.
constexpr std::array<std::uint64_t, 1024> OriginalCodes() {
  constexpr std::array<std::uint64_t, 4> kRows = {0b10000, 0b10111, 0b01001, 0b01110};
  std::array<std::uint64_t, 1024> codes{};
  for (std::size_t id = 0; id < codes.size(); ++id)
    for (int shift = 8; shift >= 0; shift -= 2)
      codes[id] = (codes[id] << 5) | kRows[(id >> shift) & 3U];
  return codes;
}

constexpr std::array<std::uint64_t, 1024> kArucoOriginalCodes = OriginalCodes();

constexpr std::span<const std::uint64_t> k4x4(kAruco4x4Codes);
constexpr std::span<const std::uint64_t> k5x5(kAruco5x5Codes);
constexpr std::span<const std::uint64_t> k6x6(kAruco6x6Codes);
constexpr std::span<const std::uint64_t> k7x7(kAruco7x7Codes);

constexpr Family kFamilies[] = {
    {"DICT_4X4_50", 4, 1, k4x4.first(50)},
    {"DICT_4X4_100", 4, 1, k4x4.first(100)},
    {"DICT_4X4_250", 4, 1, k4x4.first(250)},
    {"DICT_4X4_1000", 4, 0, k4x4},
    {"DICT_5X5_50", 5, 3, k5x5.first(50)},
    {"DICT_5X5_100", 5, 3, k5x5.first(100)},
    {"DICT_5X5_250", 5, 2, k5x5.first(250)},
    {"DICT_5X5_1000", 5, 2, k5x5},
    {"DICT_6X6_50", 6, 6, k6x6.first(50)},
    {"DICT_6X6_100", 6, 5, k6x6.first(100)},
    {"DICT_6X6_250", 6, 5, k6x6.first(250)},
    {"DICT_6X6_1000", 6, 4, k6x6},
    {"DICT_7X7_50", 7, 9, k7x7.first(50)},
    {"DICT_7X7_100", 7, 8, k7x7.first(100)},
    {"DICT_7X7_250", 7, 8, k7x7.first(250)},
    {"DICT_7X7_1000", 7, 6, k7x7},
    {"DICT_ARUCO_ORIGINAL", 5, 0, kArucoOriginalCodes},
    {"DICT_APRILTAG_16h5", 4, 0, kAprilTag16h5Codes},
    {"DICT_APRILTAG_25h9", 5, 0, kAprilTag25h9Codes},
    {"DICT_APRILTAG_36h10", 6, 0, kAprilTag36h10Codes},
    {"DICT_APRILTAG_36h11", 6, 0, kAprilTag36h11Codes},
    {"DICT_ARUCO_MIP_36h12", 6, 5, kArucoMip36h12Codes},
};

bool EqualIgnoringCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
  });
}

}  // namespace

MarkerDictionary::MarkerDictionary(std::string name, int bits_per_side, int max_correction_bits,
                                   std::vector<std::uint64_t> codes)
    : name_(std::move(name)),
      bits_per_side_(bits_per_side),
      max_correction_bits_(max_correction_bits),
      codes_(std::move(codes)) {}

std::optional<MarkerDictionary> MarkerDictionary::Find(std::string_view name) {
  for (const Family& family : kFamilies)
    if (EqualIgnoringCase(name, family.name))
      return MarkerDictionary(std::string(family.name), family.bits_per_side,
                              family.max_correction_bits,
                              {family.codes.begin(), family.codes.end()});
  return std::nullopt;
}

MarkerDictionary MarkerDictionary::ByName(std::string_view name) {
  std::optional<MarkerDictionary> dictionary = Find(name);
  if (!dictionary) {
    throw DataError(say::recording::UnknownDictionary(name.substr(0, 80), KnownNames()));
  }
  return *std::move(dictionary);
}

const std::vector<std::string>& MarkerDictionary::KnownNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Family& family : kFamilies) all.emplace_back(family.name);
    return all;
  }();
  return names;
}

bool MarkerDictionary::Bit(int id, int row, int column) const {
  if (row < 0 || row >= bits_per_side_ || column < 0 || column >= bits_per_side_) {
    throw std::invalid_argument(fmt::format("cell ({}, {}) lies outside a pattern of {} x {} of {}",
                                            row, column, bits_per_side_, bits_per_side_, name_));
  }
  const int shift = bits_per_side_ * bits_per_side_ - 1 - (row * bits_per_side_ + column);
  return ((Code(id) >> shift) & 1U) != 0;
}

std::uint64_t MarkerDictionary::Code(int id) const {
  if (id < 0 || id >= size())
    throw std::invalid_argument(
        fmt::format("marker id {} is not in {} (0 to {})", id, name_, size() - 1));
  return codes_[static_cast<std::size_t>(id)];
}

}  // namespace plumb
