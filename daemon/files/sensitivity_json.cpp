// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/sensitivity_json.hpp"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "words/scene_file.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kSensitivityFormat = 1;
constexpr std::size_t kMaxTerms = 256;
constexpr std::size_t kMaxPatches = 4096;
constexpr std::size_t kMaxSerialBytes = 256;
constexpr std::size_t kMaxMarkerDerivatives = 4096;
constexpr double kLargest = 1e12;

// Four digits are more than a sensitivity is known to.
double Rounded(double value) { return std::strtod(fmt::format("{:.4g}", value).c_str(), nullptr); }

Json Numbers(const SensorSensitivity::Derivative& derivative) {
  Json json = Json::array();
  for (Eigen::Index column = 0; column < derivative.cols(); ++column)
    for (Eigen::Index row = 0; row < 3; ++row)
      json.push_back(Rounded(static_cast<double>(derivative(row, column))));
  return json;
}

class Reader {
 public:
  explicit Reader(const std::string& name) : name_(name) {}

  [[noreturn]] void Fail(const Message& why) const {
    throw DataError(say::scene_file::Sensitivity(name_, why));
  }
  [[nodiscard]] const Json& At(const Json& json, const char* key) const {
    if (!json.is_object() || !json.contains(key)) Fail(say::scene_file::NoKey(key));
    return json[key];
  }
  [[nodiscard]] double Number(const Json& json, const char* what) const {
    if (!json.is_number()) Fail(say::scene_file::KeyNoNumber(what));
    const double value = json.get<double>();
    if (!(std::abs(value) <= kLargest)) Fail(say::scene_file::KeyOutOfRange(what));
    return value;
  }
  [[nodiscard]] Eigen::VectorXd Vector(const Json& json, std::size_t size, const char* what) const {
    if (!json.is_array() || json.size() != size)
      Fail(say::scene_file::KeyNoNumbers(what, static_cast<std::int64_t>(size)));
    Eigen::VectorXd vector(static_cast<Eigen::Index>(size));
    for (std::size_t i = 0; i < size; ++i)
      vector[static_cast<Eigen::Index>(i)] = Number(json[i], what);
    return vector;
  }
  [[nodiscard]] SensorSensitivity::Derivative Derivative(const Json& json,
                                                         std::size_t terms) const {
    return Vector(json, 3 * terms, "derivative")
        .cast<float>()
        .reshaped(3, static_cast<Eigen::Index>(terms));
  }

 private:
  const std::string& name_;
};

Json IntrinsicsRow(const Intrinsics& k) {
  Json row = {k.width, k.height, k.fx, k.fy, k.cx, k.cy};
  for (const double coefficient : LensCoefficients(k)) row.push_back(coefficient);
  return row;
}

Intrinsics ToIntrinsics(const Eigen::VectorXd& v) {
  Intrinsics k{static_cast<int>(v[0]), static_cast<int>(v[1]), v[2], v[3], v[4], v[5]};
  (void)SetLensCoefficients({v.data() + 6, v.data() + v.size()}, k);
  return k;
}

}  // namespace

std::string SensitivityJson(const SensorSensitivity& sensitivity) {
  Json json;
  json["format"] = kSensitivityFormat;
  json["stated"] = IntrinsicsRow(sensitivity.stated);
  json["stated_for_this_unit"] = sensitivity.stated_for_this_unit;
  json["serial"] = sensitivity.serial;
  json["estimate"] = Json::array();
  json["covariance"] = Json::array();
  for (Eigen::Index i = 0; i < sensitivity.estimate.size(); ++i) {
    json["estimate"].push_back(sensitivity.estimate[i]);
    for (Eigen::Index j = 0; j <= i; ++j)
      json["covariance"].push_back(sensitivity.covariance(i, j));
  }
  json["surface"] = Json::array();
  for (const SensorSensitivity::Patch& patch : sensitivity.surface)
    json["surface"].push_back(
        {{"centre_m",
          {Rounded(patch.centre_m.x()), Rounded(patch.centre_m.y()), Rounded(patch.centre_m.z())}},
         {"weight", Rounded(patch.weight)},
         {"derivative", Numbers(patch.derivative)}});
  json["markers"] = Json::object();
  for (const auto& [id, derivative] : sensitivity.markers)
    json["markers"][std::to_string(id)] = Numbers(derivative);
  return json.dump() + "\n";
}

SensorSensitivity ParseSensitivityJson(std::string_view text, const std::string& name) {
  const Reader reader(name);
  Json json;
  try {
    json = ParseBoundedJson<Json>(text);
  } catch (const DataError& error) {
    reader.Fail(error.message());
  }
  if (reader.Number(reader.At(json, "format"), "format") != kSensitivityFormat)
    reader.Fail(say::scene_file::KeyNot("format", kSensitivityFormat));
  SensorSensitivity result;
  const Json& stated = reader.At(json, "stated");
  // With the five coefficients of a plain lens, or the eight of a rational one.
  result.stated = ToIntrinsics(reader.Vector(stated, stated.size() == 14 ? 14 : 11, "stated"));
  const Json& own = reader.At(json, "stated_for_this_unit");
  if (!own.is_boolean()) reader.Fail(say::scene_file::KeyNoFlag("stated_for_this_unit"));
  result.stated_for_this_unit = own.get<bool>();
  const Json& serial = reader.At(json, "serial");
  if (!serial.is_string() || serial.get_ref<const std::string&>().size() > kMaxSerialBytes)
    reader.Fail(say::scene_file::KeyNoShortText("serial", kMaxSerialBytes));
  result.serial = serial.get<std::string>();
  const Json& estimate = reader.At(json, "estimate");
  const std::size_t terms = estimate.size();
  if (terms == 0 || terms > kMaxTerms) reader.Fail(say::scene_file::KeyTermCount("estimate"));
  result.estimate = reader.Vector(estimate, terms, "estimate");
  const Eigen::VectorXd lower =
      reader.Vector(reader.At(json, "covariance"), terms * (terms + 1) / 2, "covariance");
  const auto n = static_cast<Eigen::Index>(terms);
  result.covariance.resize(n, n);
  for (Eigen::Index i = 0, k = 0; i < n; ++i)
    for (Eigen::Index j = 0; j <= i; ++j, ++k)
      result.covariance(i, j) = result.covariance(j, i) = lower[k];
  const Json& surface = reader.At(json, "surface");
  if (!surface.is_array() || surface.size() > kMaxPatches)
    reader.Fail(say::scene_file::KeyNoShortList("surface", kMaxPatches));
  for (const Json& patch : surface) {
    SensorSensitivity::Patch& read = result.surface.emplace_back();
    read.centre_m = reader.Vector(reader.At(patch, "centre_m"), 3, "centre_m").cast<float>();
    read.weight = static_cast<float>(reader.Number(reader.At(patch, "weight"), "weight"));
    if (!(read.weight > 0)) reader.Fail(say::scene_file::WeightNotPositive());
    read.derivative = reader.Derivative(reader.At(patch, "derivative"), terms);
  }
  const Json& markers = reader.At(json, "markers");
  if (!markers.is_object() || markers.size() > kMaxMarkerDerivatives)
    reader.Fail(say::scene_file::KeyNoSmallObject("markers", kMaxMarkerDerivatives));
  for (const auto& [id, derivative] : markers.items()) {
    if (id.empty() || id.size() > 5 || id.find_first_not_of("0123456789") != std::string::npos)
      reader.Fail(say::scene_file::MarkerWithoutId());
    result.markers[std::stoi(id)] = reader.Derivative(derivative, terms);
  }
  return result;
}

}  // namespace plumb
