// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/phone_metadata.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "algo/base/statistics.hpp"
#include "drivers/importers/recorded_file.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

constexpr double kLatest_s = 1e10;
/// Of a camera that focuses, as a share of the focal length; phones' change by 1 to 2 %.
constexpr double kMostChangeOfCamera = 0.1;

/// Record3D keeps its camera's kind so: 0 is the one above the screen, which projects dots.
constexpr int kFrontCamera = 0;

void AddStamp(double time_s, const std::string& name, std::vector<double>& stamps_s) {
  const auto before = std::find_if(stamps_s.rbegin(), stamps_s.rend(),
                                   [](double stamp_s) { return !std::isnan(stamp_s); });
  if (!(time_s >= 0 && time_s < kLatest_s) || (before != stamps_s.rend() && !(time_s > *before)))
    throw DataError(say::foreign::StampsFall(name, std::ssize(stamps_s)));
  if (stamps_s.size() >= kMostRecordedImages)
    throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
  stamps_s.push_back(time_s);
}

/// The text until the next end, which is taken off with it.
std::string_view Cut(std::string_view& text, char end) {
  const std::size_t at = text.find(end);
  const std::string_view part = text.substr(0, at);
  text.remove_prefix(at == std::string_view::npos ? text.size() : at + 1);
  const std::size_t begin = part.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return {};
  return part.substr(begin, part.find_last_not_of(" \t\r") - begin + 1);
}

int SideOf(const nlohmann::json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number()) return 0;
  const auto side = found->get<double>();
  return side > 0 && side < 1e5 ? static_cast<int>(side) : 0;
}

/// The camera of each image, as far as stated: fx, fy, cx, cy. Their median replaces the one of the
/// whole, which is the first image's.
void TakeCamerasOfImages(const nlohmann::json& json, PhoneMetadata& phone) {
  const auto stated = json.find("perFrameIntrinsicCoeffs");
  if (stated == json.end() || !stated->is_array()) return;
  std::array<std::vector<double>, 4> of_images;
  const std::array usual = {&phone.fx, &phone.fy, &phone.cx, &phone.cy};
  for (const auto& one : *stated) {
    if (!one.is_array() || one.size() != of_images.size()) return;
    for (std::size_t i = 0; i < of_images.size(); ++i) {
      if (!one[i].is_number()) return;
      // Of images that are stored turned, or of another size, it is not this camera.
      const auto value = one[i].get<double>();
      if (!(std::abs(value - *usual[i]) <= kMostChangeOfCamera * phone.fx)) return;
      of_images[i].push_back(value);
    }
  }
  if (of_images[0].empty()) return;
  const auto [least, most] = std::ranges::minmax(of_images[0]);
  for (std::size_t i = 0; i < of_images.size(); ++i) *usual[i] = TakeMedian(of_images[i]);
  phone.focal_spread = (most - least) / phone.fx;
}

}  // namespace

std::optional<PhoneMetadata> ParseRecord3d(std::string_view text, const std::string& name) {
  const auto json = ParseBoundedJsonOrNothing<nlohmann::json>(text);
  if (!json.is_object() || !json.contains("K") || !json.contains("w") || !json.contains("h"))
    return std::nullopt;
  std::array<double, 9> k{};  // By columns.
  const auto& stated = json["K"];
  if (!stated.is_array() || stated.size() != k.size())
    throw DataError(say::foreign::NoNumber(name, "K"));
  for (std::size_t i = 0; i < k.size(); ++i) {
    if (!stated[i].is_number()) throw DataError(say::foreign::NoNumber(name, "K"));
    k[i] = stated[i].get<double>();
  }
  PhoneMetadata phone{.fx = k[0], .fy = k[4], .cx = k[6], .cy = k[7]};
  TakeCamerasOfImages(json, phone);
  phone.width = SideOf(json, "w");
  phone.height = SideOf(json, "h");
  if (const auto fps = json.find("fps"); fps != json.end() && fps->is_number())
    if (const auto rate_hz = fps->get<double>(); rate_hz >= 1 && rate_hz <= 240)
      phone.rate_hz = rate_hz;
  if (const auto kind = json.find("cameraType");
      kind != json.end() && kind->is_number_integer() && kind->get<int>() == kFrontCamera)
    phone.sensor = DepthSensor::kStructuredLight;
  if (const auto stamps = json.find("frameTimestamps"); stamps != json.end() && stamps->is_array())
    for (const auto& stamp : *stamps) {
      if (!stamp.is_number()) throw DataError(say::foreign::NoNumber(name, "frameTimestamps"));
      AddStamp(stamp.get<double>(), name, phone.stamps_s);
    }
  return phone;
}

PhoneMetadata ParseStray(std::string_view matrix, std::string_view odometry) {
  std::array<double, 9> k{};
  for (std::size_t row = 0; row < 3; ++row) {
    std::string_view line = Cut(matrix, '\n');
    for (std::size_t column = 0; column < 3; ++column) {
      const std::optional<double> value = ParseNumber<double>(Cut(line, ','));
      if (!value) throw DataError(say::foreign::NoNumber("camera_matrix.csv", "fx"));
      k[3 * row + column] = *value;
    }
  }
  PhoneMetadata phone{.fx = k[0], .fy = k[4], .cx = k[2], .cy = k[5]};
  (void)Cut(odometry, '\n');  // Names of the columns.
  while (!odometry.empty()) {
    std::string_view line = Cut(odometry, '\n');
    if (line.empty()) continue;
    const std::optional<double> time_s = ParseNumber<double>(Cut(line, ','));
    const std::optional<std::int64_t> number = ParseNumber<std::int64_t>(Cut(line, ','));
    if (!time_s || !number || *number < std::ssize(phone.stamps_s))
      throw DataError(say::foreign::NoNumber("odometry.csv", "timestamp, frame"));
    if (*number >= static_cast<std::int64_t>(kMostRecordedImages))
      throw DataError(say::foreign::TooManyImages(kMostRecordedImages));
    // A frame that the app left out has no stamp.
    phone.stamps_s.resize(static_cast<std::size_t>(*number), NAN);
    AddStamp(*time_s, "odometry.csv", phone.stamps_s);
  }
  return phone;
}

}  // namespace plumb
