// An appliance whose database fails under it.
#include <chrono>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/appliance/appliance.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

TEST(ApplianceStorage, ADatabaseThatCannotBeReadAnyMoreIsSafeModeAndNotTheEnd) {
  const testing::TempFolder folder;
  testing::FakeBus bus;
  EventLoop loop;
  Config config;
  config.appliance.state = folder / "state";
  {
    Store store(config.appliance.state);  // and closed again: nothing of it is in anybody's memory
    (void)store.AddPatient({.user = "anna", .address = {}}, "A", "");
  }
  Appliance appliance(
      loop, {.config = config,
             .make_provider = [&] { return std::make_unique<testing::FakeProvider>(bus); },
             .before_scan = {},
             .button = nullptr,
             .indicator = nullptr,
             .demo_patient = {}});
  for (const fs::directory_entry& entry : fs::directory_iterator(config.appliance.state)) {
    if (!entry.is_regular_file()) continue;
    std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);  // behind the header
    file << std::string(fs::file_size(entry.path()), 'x');
  }
  EXPECT_EQ(appliance.WebStatus().state, web::ApplianceState::kNoSensor);
  EventLoop::Source timer = loop.MakeTimer("end", [&] { loop.Quit(0); });
  timer.ArmAfter(std::chrono::milliseconds(50));
  EXPECT_EQ(loop.Run(), 0);
  EXPECT_THAT(appliance.storage_fault(), HasSubstr("damaged"));
  EXPECT_FALSE(appliance.WebStatus().fault.empty());
  EXPECT_FALSE(appliance.Health().ok);
}

}  // namespace
}  // namespace plumb
