// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/sensitivity_json.hpp"

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using testing::MessageOf;

SensorSensitivity Sample() {
  SensorSensitivity s;
  s.stated = {640, 480, 525.5, 524.25, 319.5, 239.5, {0.1, -0.2, 0.001, 0.002, 0.05}};
  s.stated_for_this_unit = true;
  s.serial = "1804060024";
  s.estimate = Eigen::Vector3d(0.001, -1.25, 3.0 / 7.0);
  s.covariance = Eigen::Matrix3d::Zero();
  s.covariance << 4, 1, 0.5, 1, 9, 0.25, 0.5, 0.25, 1.0 / 3.0;
  SensorSensitivity::Derivative d(3, 3);
  d << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  s.surface.push_back({Eigen::Vector3f(0.25F, 0.5F, -0.125F), 75.0F, d});
  s.markers[7] = 0.5F * d;
  return s;
}

TEST(SensitivityJsonTest, ComesBackAsItWas) {
  const SensorSensitivity s = Sample();
  const SensorSensitivity read = ParseSensitivityJson(SensitivityJson(s), "sensitivity.json");
  EXPECT_EQ(read.stated, s.stated);
  EXPECT_TRUE(read.stated_for_this_unit);
  EXPECT_EQ(read.serial, "1804060024");
  EXPECT_EQ(read.estimate, s.estimate);
  EXPECT_EQ(read.covariance, s.covariance);
  ASSERT_EQ(read.surface.size(), 1U);
  EXPECT_EQ(read.surface[0].centre_m, s.surface[0].centre_m);
  EXPECT_EQ(read.surface[0].weight, 75.0F);
  EXPECT_EQ(read.surface[0].derivative, s.surface[0].derivative);
  ASSERT_EQ(read.markers.size(), 1U);
  EXPECT_EQ(read.markers.at(7), s.markers.at(7));
}

TEST(SensitivityJsonTest, WrongFilesAreRefusedByName) {
  const std::string good = SensitivityJson(Sample());
  const auto refused = [](std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    return MessageOf<DataError>([&] { (void)ParseSensitivityJson(text, "file.json"); });
  };
  const auto contains = [](const std::string& message, const char* what) {
    return message.find("file.json") != std::string::npos &&
           message.find(what) != std::string::npos;
  };
  EXPECT_TRUE(contains(refused(good, "\"format\":1", "\"format\":2"), "format"));
  EXPECT_TRUE(contains(refused(good, "\"serial\":\"1804060024\"", "\"serial\":7"), "serial"));
  EXPECT_TRUE(contains(refused(good, "1804060024", std::string(257, 'S')), "serial"));
  EXPECT_TRUE(contains(refused(good, "\"weight\":75.0", "\"weight\":0"), "weight"));
  EXPECT_TRUE(contains(refused(good, "\"7\":[", "\"x\":["), "id"));
  EXPECT_TRUE(contains(refused(good, "\"7\":[0.5,", "\"7\":["), "derivative"));
  EXPECT_TRUE(contains(refused(good, "\"estimate\":[", "\"estimate\":[1,"), "covariance"));
  EXPECT_TRUE(contains(refused(good, "\"estimate\":[", "\"estimate\":[1e300,"), "estimate"));
  EXPECT_TRUE(contains(refused(good, "{", ""), "file.json"));
}

}  // namespace
}  // namespace plumb
