// SPDX-License-Identifier: Apache-2.0
// The registry of drivers: names, kinds and what a wrong name is answered with.
#include "drivers/live/sensor_driver.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::MessageOf;
using ::testing::Not;

SensorDriver Driver(const std::string& name, bool is_simulated) {
  class Empty : public SensorSetup {
   public:
    [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override { return nullptr; }
  };
  return {.name = name,
          .title = "driver " + name,
          .is_simulated = is_simulated,
          .set_up = [](const auto&...) { return std::make_unique<Empty>(); }};
}

class SensorRegistryTest : public ::testing::Test {
 protected:
  SensorRegistryTest() {
    for (const char* name : {"stereo", "flight"}) registry_.Add(Driver(name, false));
    for (const char* name : {"puppet", "film"}) registry_.Add(Driver(name, true));
  }
  [[nodiscard]] std::string Complaint(const std::string& name, bool simulated) const {
    return MessageOf<DataError>([&] { (void)registry_.Choose(name, simulated); });
  }
  SensorRegistry registry_;
};

TEST_F(SensorRegistryTest, ADriverIsFoundByItsNameAndTheFirstOfItsKindWithoutOne) {
  EXPECT_EQ(registry_.Choose("flight", false).name, "flight");
  EXPECT_EQ(registry_.Choose("film", true).name, "film");
  EXPECT_EQ(registry_.Choose("", false).name, "stereo");
  EXPECT_EQ(registry_.Choose("", true).name, "puppet");
}

TEST_F(SensorRegistryTest, AnUnknownNameIsRefusedWithTheNamesThatAreKnown) {
  EXPECT_THAT(Complaint("flihgt", false),
              AllOf(HasSubstr("[sensor] driver"), HasSubstr("\"stereo\", \"flight\""),
                    HasSubstr("found \"flihgt\""), Not(HasSubstr("puppet"))));
}

TEST_F(SensorRegistryTest, ASimulatedSensorIsNeverTakenForARealOneNorTheOtherWayRound) {
  EXPECT_THAT(Complaint("film", false),
              AllOf(HasSubstr("\"film\" shows simulated images"), HasSubstr("--simulated"),
                    HasSubstr("\"stereo\", \"flight\"")));
  EXPECT_THAT(Complaint("stereo", true),
              AllOf(HasSubstr("\"stereo\" reads real sensors"), HasSubstr("\"puppet\", \"film\"")));
}

TEST_F(SensorRegistryTest, ANameIsTakenOnce) {
  EXPECT_THAT(MessageOf<std::invalid_argument>([&] { registry_.Add(Driver("film", false)); }),
              HasSubstr("\"film\""));
  EXPECT_THROW(registry_.Add(Driver("", false)), std::invalid_argument);
}

TEST(EmptySensorRegistryTest, WithoutDriversOnlyOpeningASensorFails) {
  const SensorRegistry registry;
  const auto setup = registry.Choose("", false).set_up({}, {}, {}, {});
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)setup->MakeProvider(); }), HasSubstr("no driver"));
  EXPECT_THAT(MessageOf<DeviceError>([&] { (void)setup->Command("plug"); }),
              HasSubstr("start plumbd with --simulated"));
}

}  // namespace
}  // namespace plumb
