// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/sensor_profile_file.hpp"

#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

SensorProfile Profile() {
  Intrinsics k;
  k.width = 640;
  k.height = 480;
  k.fx = 527.499;
  k.fy = 527.5;
  k.cx = 316.529;
  k.cy = 248.331;
  k.distortion = {0.0668, -0.168, -0.00044, 0.00033, 0.036};
  SensorProfile profile = ProfileOfAnyUnit(k);
  profile.num_sweeps = 3;
  profile.mean[kLensAt] = 0.00123456789012345;
  profile.mean[kDepthAt + kDepthField + 5] = -1e-7;
  profile.covariance(0, 1) = profile.covariance(1, 0) = 1e-9;
  return profile;
}

class SensorProfileFile : public ::testing::Test {
 protected:
  void Write(const nlohmann::json& json) { std::ofstream(file_) << json.dump(); }
  [[nodiscard]] nlohmann::json Good() const {
    return nlohmann::json::parse(SensorProfileJson(Profile()));
  }
  void ExpectRefused(const std::string& word) {
    try {
      static_cast<void>(ReadSensorProfile(file_));
      ADD_FAILURE() << "read";
    } catch (const DataError& error) {
      const std::string what = error.what();
      EXPECT_NE(what.find(word), std::string::npos) << what;
      EXPECT_NE(what.find("unit.json"), std::string::npos) << what;
    }
  }
  testing::TempFolder folder_;
  std::filesystem::path file_ = folder_ / "unit.json";
};

TEST_F(SensorProfileFile, ARationalLensComesBackToo) {
  SensorProfile profile = Profile();
  profile.stated.distortion = {0.51, -2.74, 0.0006, -0.0002, 1.64, 0.39, -2.55, 1.56};
  WriteSensorProfile(profile, file_);
  EXPECT_EQ(ReadSensorProfile(file_).stated, profile.stated);
  nlohmann::json json = Good();
  json["stated_intrinsics"]["distortion"].push_back(0.1);
  Write(json);
  ExpectRefused("distortion");
}

TEST_F(SensorProfileFile, ComesBackToTheLastBit) {
  WriteSensorProfile(Profile(), file_);
  const SensorProfile read = ReadSensorProfile(file_);
  EXPECT_EQ(read.name, "unit.json");
  EXPECT_EQ(read.num_sweeps, 3);
  EXPECT_EQ(read.stated, Profile().stated);
  EXPECT_EQ(read.mean, Profile().mean);
  EXPECT_EQ(read.covariance, Profile().covariance);
}

TEST_F(SensorProfileFile, WhatIsNoProfileIsRefused) {
  std::ofstream(file_) << "{";
  ExpectRefused("plumb calibrate");
  Write({{"format", "something else"}});
  ExpectRefused("not a sensor profile");
  auto json = Good();
  json["version"] = 2;
  Write(json);
  ExpectRefused("version is 2, expected 1");
  json = Good();
  json["mean"].erase(0);
  Write(json);
  ExpectRefused("mean holds");
  json = Good();
  json["covariance"].push_back(0.0);
  Write(json);
  ExpectRefused("covariance holds");
  json = Good();
  json["covariance"][0] = -1.0;
  Write(json);
  ExpectRefused("positive definite");
  json = Good();
  json["covariance"][1] = 1e-5;  // Not the same as its mirror.
  Write(json);
  ExpectRefused("symmetric");
  json = Good();
  json["sweeps"] = -1;
  Write(json);
  ExpectRefused("sweeps");
  json = Good();
  json["mean"][0] = "far";
  Write(json);
  ExpectRefused("unit.json");
}

TEST_F(SensorProfileFile, AHugeFileIsNotRead) {
  std::ofstream(file_) << std::string((1U << 20U) + 1, ' ');
  EXPECT_THROW(static_cast<void>(ReadSensorProfile(file_)), DataError);
}

}  // namespace
}  // namespace plumb
