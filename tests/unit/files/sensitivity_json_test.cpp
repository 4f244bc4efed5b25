// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/sensitivity_json.hpp"

#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"
#include "tests/unit/files/small_output.hpp"

namespace plumb {
namespace {

using testing::MessageOf;

TEST(SensitivityJsonTest, ComesBackAsItWas) {
  const SensorSensitivity s = testing::SmallSensitivity();
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
  const std::string good = SensitivityJson(testing::SmallSensitivity());
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
