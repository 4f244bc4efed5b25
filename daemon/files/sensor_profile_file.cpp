// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/sensor_profile_file.hpp"

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "drivers/files/file_io.hpp"
#include "words/scene_file.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kProfileFormat = "plumb-sensor-profile";
constexpr int kVersion = 1;
constexpr std::size_t kMaxBytes = 1U << 20U;

std::vector<double> Flat(const Eigen::Ref<const Eigen::MatrixXd>& m) {
  std::vector<double> values;
  for (Eigen::Index r = 0; r < m.rows(); ++r)
    for (Eigen::Index c = 0; c < m.cols(); ++c) values.push_back(m(r, c));
  return values;
}

// Numbers of a list of exactly this length.
std::vector<double> Numbers(const Json& json, const char* key, std::size_t count) {
  const auto values = json.at(key).get<std::vector<double>>();
  if (values.size() != count)
    throw DataError(say::scene_file::ProfileCount(key, static_cast<std::int64_t>(values.size()),
                                                  static_cast<std::int64_t>(count)));
  for (const double value : values)
    if (!std::isfinite(value)) throw DataError(say::scene_file::ProfileNotFinite(key));
  return values;
}

Json IntrinsicsJson(const Intrinsics& k) {
  return {{"width", k.width},
          {"height", k.height},
          {"fx_px", k.fx},
          {"fy_px", k.fy},
          {"cx_px", k.cx},
          {"cy_px", k.cy},
          {"distortion", LensCoefficients(k)}};
}

Intrinsics ParseIntrinsics(const Json& json) {
  Intrinsics k;
  k.width = json.at("width").get<int>();
  k.height = json.at("height").get<int>();
  k.fx = json.at("fx_px").get<double>();
  k.fy = json.at("fy_px").get<double>();
  k.cx = json.at("cx_px").get<double>();
  k.cy = json.at("cy_px").get<double>();
  if (!SetLensCoefficients(json.at("distortion").get<std::vector<double>>(), k))
    throw DataError(say::scene_file::KeyNoNumbers("distortion", 5));
  return k;
}

SensorProfile Parse(const std::string& text) {
  const Json json = ParseBoundedJson<Json>(text);
  if (json.at("format") != kProfileFormat) throw DataError(say::scene_file::ProfileFormat());
  if (json.at("version") != kVersion)
    throw DataError(say::scene_file::ProfileVersion(json.at("version").dump(), kVersion));
  SensorProfile profile;
  profile.num_sweeps = json.at("sweeps").get<int>();
  if (profile.num_sweeps < 0) throw DataError(say::scene_file::ProfileSweeps());
  profile.stated = ParseIntrinsics(json.at("stated_intrinsics"));
  const auto mean = Numbers(json, "mean", kCalibrationSize);
  const auto covariance =
      Numbers(json, "covariance", std::size_t{kCalibrationSize} * kCalibrationSize);
  profile.mean = Eigen::Map<const CalibrationVector>(mean.data());
  profile.covariance = Eigen::Map<const CalibrationMatrix>(covariance.data());
  if (!profile.covariance.isApprox(profile.covariance.transpose(), 1e-9) ||
      Eigen::LLT<CalibrationMatrix>(profile.covariance).info() != Eigen::Success)
    throw DataError(say::scene_file::ProfileCovariance());
  return profile;
}

}  // namespace

SensorProfile ParseSensorProfile(const std::string& text) {
  try {
    return Parse(text);
  } catch (const nlohmann::json::exception& error) {
    throw DataError(say::scene_file::ProfileNotOne(MessageOf(error)));
  }
}

SensorProfile ReadSensorProfile(const std::filesystem::path& file) {
  try {
    SensorProfile profile = Parse(ReadTextFile(file, kMaxBytes));
    profile.name = file.filename().string();
    return profile;
  } catch (const nlohmann::json::exception& error) {
    throw DataError(say::scene_file::Profile(file.string(), MessageOf(error)));
  } catch (const DataError& error) {
    throw DataError(say::scene_file::Profile(file.string(), MessageOf(error)));
  }
}

std::string SensorProfileJson(const SensorProfile& profile) {
  CalibrationModel model;
  MoveCalibration(profile.mean, model);
  Json json;
  json["format"] = kProfileFormat;
  json["version"] = kVersion;
  json["sweeps"] = profile.num_sweeps;
  json["stated_intrinsics"] = IntrinsicsJson(profile.stated);
  json["calibration"] = model.Named();  // for people; the vector below is what is read
  json["mean"] = Flat(profile.mean);
  json["covariance"] = Flat(profile.covariance);
  return json.dump(1) + "\n";
}

void WriteSensorProfile(const SensorProfile& profile, const std::filesystem::path& file) {
  const std::string text = SensorProfileJson(profile);
  WriteFileAtomically(file, [&](const std::filesystem::path& at) { WriteWholeFile(at, text); });
}

}  // namespace plumb
