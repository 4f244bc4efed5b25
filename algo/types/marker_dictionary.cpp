#include "algo/types/marker_dictionary.hpp"

#include <algorithm>
#include <cctype>
#include <opencv2/aruco/dictionary.hpp>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/types/aruco_mip_36h12.hpp"
#include "algo/types/errors.hpp"

namespace plumb {
namespace {

constexpr std::string_view kMip36h12 = "DICT_ARUCO_MIP_36h12";

struct PredefinedName {
  std::string_view name;
  cv::aruco::PREDEFINED_DICTIONARY_NAME id;
};

constexpr PredefinedName kPredefined[] = {
    {"DICT_4X4_50", cv::aruco::DICT_4X4_50},
    {"DICT_4X4_100", cv::aruco::DICT_4X4_100},
    {"DICT_4X4_250", cv::aruco::DICT_4X4_250},
    {"DICT_4X4_1000", cv::aruco::DICT_4X4_1000},
    {"DICT_5X5_50", cv::aruco::DICT_5X5_50},
    {"DICT_5X5_100", cv::aruco::DICT_5X5_100},
    {"DICT_5X5_250", cv::aruco::DICT_5X5_250},
    {"DICT_5X5_1000", cv::aruco::DICT_5X5_1000},
    {"DICT_6X6_50", cv::aruco::DICT_6X6_50},
    {"DICT_6X6_100", cv::aruco::DICT_6X6_100},
    {"DICT_6X6_250", cv::aruco::DICT_6X6_250},
    {"DICT_6X6_1000", cv::aruco::DICT_6X6_1000},
    {"DICT_7X7_50", cv::aruco::DICT_7X7_50},
    {"DICT_7X7_100", cv::aruco::DICT_7X7_100},
    {"DICT_7X7_250", cv::aruco::DICT_7X7_250},
    {"DICT_7X7_1000", cv::aruco::DICT_7X7_1000},
    {"DICT_ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"DICT_APRILTAG_16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"DICT_APRILTAG_25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"DICT_APRILTAG_36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"DICT_APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11},
};

bool EqualIgnoringCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) == std::tolower(static_cast<unsigned char>(y));
  });
}

std::uint64_t PackBits(const cv::Mat& bits) {
  std::uint64_t code = 0;
  for (int row = 0; row < bits.rows; ++row)
    for (int column = 0; column < bits.cols; ++column) code = (code << 1) | (bits.at<std::uint8_t>(row, column) != 0 ? 1U : 0U);
  return code;
}

std::vector<std::uint64_t> CodesOf(const cv::aruco::Dictionary& dictionary) {
  std::vector<std::uint64_t> codes;
  codes.reserve(static_cast<std::size_t>(dictionary.bytesList.rows));
  for (int id = 0; id < dictionary.bytesList.rows; ++id) {
    codes.push_back(PackBits(cv::aruco::Dictionary::getBitsFromByteList(dictionary.bytesList.rowRange(id, id + 1), dictionary.markerSize)));
  }
  return codes;
}

}  // namespace

MarkerDictionary::MarkerDictionary(std::string name, int bits_per_side, int max_correction_bits, std::vector<std::uint64_t> codes)
    : name_(std::move(name)), bits_per_side_(bits_per_side), max_correction_bits_(max_correction_bits), codes_(std::move(codes)) {}

std::optional<MarkerDictionary> MarkerDictionary::Find(std::string_view name) {
  if (EqualIgnoringCase(name, kMip36h12)) {
    // Distance 12: five wrong bits still have one nearest code.
    return MarkerDictionary(std::string(kMip36h12), 6, 5, {kArucoMip36h12Codes.begin(), kArucoMip36h12Codes.end()});
  }
  for (const PredefinedName& predefined : kPredefined) {
    if (!EqualIgnoringCase(name, predefined.name)) continue;
    const cv::Ptr<cv::aruco::Dictionary> dictionary = cv::aruco::getPredefinedDictionary(predefined.id);
    return MarkerDictionary(std::string(predefined.name), dictionary->markerSize, dictionary->maxCorrectionBits, CodesOf(*dictionary));
  }
  return std::nullopt;
}

MarkerDictionary MarkerDictionary::ByName(std::string_view name) {
  std::optional<MarkerDictionary> dictionary = Find(name);
  if (!dictionary) {
    throw DataError(
        fmt::format("unknown marker dictionary '{}': expected one of {}; correct marker_dictionary in camera.yaml or the configuration",
                    name.substr(0, 80), fmt::join(KnownNames(), ", ")));
  }
  return *std::move(dictionary);
}

const std::vector<std::string>& MarkerDictionary::KnownNames() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const PredefinedName& predefined : kPredefined) all.emplace_back(predefined.name);
    all.emplace_back(kMip36h12);
    return all;
  }();
  return names;
}

bool MarkerDictionary::Bit(int id, int row, int column) const {
  if (row < 0 || row >= bits_per_side_ || column < 0 || column >= bits_per_side_) {
    throw std::invalid_argument(
        fmt::format("cell ({}, {}) lies outside a pattern of {} x {} of {}", row, column, bits_per_side_, bits_per_side_, name_));
  }
  const int shift = bits_per_side_ * bits_per_side_ - 1 - (row * bits_per_side_ + column);
  return ((Code(id) >> shift) & 1U) != 0;
}

std::uint64_t MarkerDictionary::Code(int id) const {
  if (id < 0 || id >= size()) throw std::invalid_argument(fmt::format("marker id {} is not in {} (0 to {})", id, name_, size() - 1));
  return codes_[static_cast<std::size_t>(id)];
}

}  // namespace plumb
