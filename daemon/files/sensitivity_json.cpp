#include "daemon/files/sensitivity_json.hpp"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"

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

  [[noreturn]] void Fail(const std::string& what) const {
    throw DataError(fmt::format("{}: {}; make the scene again", name_, what));
  }
  [[nodiscard]] const Json& At(const Json& json, const char* key) const {
    if (!json.is_object() || !json.contains(key)) Fail(fmt::format("{} is missing", key));
    return json[key];
  }
  [[nodiscard]] double Number(const Json& json, const char* what) const {
    if (!json.is_number()) Fail(fmt::format("{} is no number", what));
    const double value = json.get<double>();
    if (!(std::abs(value) <= kLargest)) Fail(fmt::format("{} is out of range", what));
    return value;
  }
  [[nodiscard]] Eigen::VectorXd Vector(const Json& json, std::size_t size, const char* what) const {
    if (!json.is_array() || json.size() != size)
      Fail(fmt::format("{} is no list of {} numbers", what, size));
    Eigen::VectorXd vector(static_cast<Eigen::Index>(size));
    for (std::size_t i = 0; i < size; ++i)
      vector[static_cast<Eigen::Index>(i)] = Number(json[i], what);
    return vector;
  }
  [[nodiscard]] SensorSensitivity::Derivative Derivative(const Json& json,
                                                         std::size_t terms) const {
    return Vector(json, 3 * terms, "a derivative")
        .cast<float>()
        .reshaped(3, static_cast<Eigen::Index>(terms));
  }

 private:
  const std::string& name_;
};

Json IntrinsicsRow(const Intrinsics& k) {
  return {k.width,
          k.height,
          k.fx,
          k.fy,
          k.cx,
          k.cy,
          k.distortion[0],
          k.distortion[1],
          k.distortion[2],
          k.distortion[3],
          k.distortion[4]};
}

Intrinsics ToIntrinsics(const Eigen::VectorXd& v) {
  return {static_cast<int>(v[0]),         static_cast<int>(v[1]), v[2], v[3], v[4], v[5],
          {v[6], v[7], v[8], v[9], v[10]}};
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
    reader.Fail(error.what());
  }
  if (reader.Number(reader.At(json, "format"), "format") != kSensitivityFormat)
    reader.Fail(fmt::format("format is not {}", kSensitivityFormat));
  SensorSensitivity result;
  result.stated = ToIntrinsics(reader.Vector(reader.At(json, "stated"), 11, "stated"));
  const Json& own = reader.At(json, "stated_for_this_unit");
  if (!own.is_boolean()) reader.Fail("stated_for_this_unit is neither true nor false");
  result.stated_for_this_unit = own.get<bool>();
  const Json& serial = reader.At(json, "serial");
  if (!serial.is_string() || serial.get_ref<const std::string&>().size() > kMaxSerialBytes)
    reader.Fail(fmt::format("serial is no text of at most {} bytes", kMaxSerialBytes));
  result.serial = serial.get<std::string>();
  const Json& estimate = reader.At(json, "estimate");
  const std::size_t terms = estimate.size();
  if (terms == 0 || terms > kMaxTerms) reader.Fail("estimate has no or too many terms");
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
    reader.Fail(fmt::format("surface is no list of at most {}", kMaxPatches));
  for (const Json& patch : surface) {
    SensorSensitivity::Patch& read = result.surface.emplace_back();
    read.centre_m = reader.Vector(reader.At(patch, "centre_m"), 3, "centre_m").cast<float>();
    read.weight = static_cast<float>(reader.Number(reader.At(patch, "weight"), "weight"));
    if (!(read.weight > 0)) reader.Fail("a weight is not positive");
    read.derivative = reader.Derivative(reader.At(patch, "derivative"), terms);
  }
  const Json& markers = reader.At(json, "markers");
  if (!markers.is_object() || markers.size() > kMaxMarkerDerivatives)
    reader.Fail(fmt::format("markers is no object of at most {}", kMaxMarkerDerivatives));
  for (const auto& [id, derivative] : markers.items()) {
    if (id.empty() || id.size() > 5 || id.find_first_not_of("0123456789") != std::string::npos)
      reader.Fail("a marker has no id");
    result.markers[std::stoi(id)] = reader.Derivative(derivative, terms);
  }
  return result;
}

}  // namespace plumb
