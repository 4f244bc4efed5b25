// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/fixed_places.hpp"

#include <fstream>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "drivers/files/temporary.hpp"

namespace plumb {
namespace {

class FixedPlacesTest : public ::testing::Test {
 protected:
  static Pose At(double x_m, double turn_rad = 0.0) {
    Pose T = Pose::Identity();
    T.linear() = Eigen::AngleAxisd(0.7 + turn_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
    T.translation() = Eigen::Vector3d(x_m, -0.4, 1.9);
    return T;
  }
  std::string Said(const std::string& serial, const Pose& T_room_camera) const {
    return CheckFixedPlace(file_, serial, T_room_camera).English();
  }
  void Write(const std::string& text) const { std::ofstream(file_) << text; }
  std::string Text() const {
    std::ifstream in(file_);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  TemporaryFolder folder_{std::filesystem::temp_directory_path(), "plumb_test_"};
  const std::filesystem::path file_ = folder_.path() / "fixed-sensors.json";
};

using ::testing::HasSubstr;

TEST_F(FixedPlacesTest, APlaceIsLearnedOnceAndComparedEachTimeAfter) {
  EXPECT_THAT(Said("A", At(1.0)), HasSubstr("the place of sensor A in the room was learned"));
  EXPECT_THAT(Said("B", At(-1.0)), HasSubstr("sensor B in the room was learned"));
  EXPECT_EQ(Said("A", At(1.0)), "");
  EXPECT_EQ(Said("A", At(1.0 + 4.5 * kMillimetre, 0.4 * kDegree)), "") << "as markers leave open";
  EXPECT_THAT(Said("A", At(1.0 + 6 * kMillimetre)), HasSubstr("sensor A stands 6 mm and 0.0"));
  EXPECT_THAT(Said("A", At(1.0, 0.6 * kDegree)), HasSubstr("0 mm and 0.6"));
  EXPECT_EQ(Said("A", At(1.0)), "") << "what it is compared with stays";
  EXPECT_EQ(Said("B", At(-1.0)), "");
}

TEST_F(FixedPlacesTest, AFileThatCannotBeUsedIsLeftAsItIsAndSaid) {
  std::string scaled = "{\"A\": [";
  for (int i = 0; i < 16; ++i) scaled += i % 5 == 0 ? "1.01," : "0,";
  scaled.back() = ']';
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string("{\"A\": 1}"),
        std::string("{\"A\": [1, 0, 0]}"), scaled + "}", std::string(70'000, ' ')}) {
    Write(text);
    EXPECT_THAT(Said("A", At(1.0)), HasSubstr("was not checked")) << text.substr(0, 60);
    EXPECT_EQ(Text(), text);
  }
}

}  // namespace
}  // namespace plumb
