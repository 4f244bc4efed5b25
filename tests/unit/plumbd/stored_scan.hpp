// SPDX-License-Identifier: Apache-2.0
// One scan with a driver's sensor, from the button to what is stored.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "daemon/appliance/appliance.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/simulator/suites/suite.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"

namespace plumb::testing {

/// The first sweep of the simulator's demo, small and at 15 Hz.
inline std::unique_ptr<FrameSource> DemoSweep(int frames) {
  SimulateOptions options;
  options.suite = "demo";
  options.faults = simulated::MildFaults(options.noise);
  options.frames = frames;
  options.rate_hz = 15.0;
  options.width = 320;
  options.height = 240;
  return simulated::MakeSource(simulated::PlanSuite(options), 0);
}

struct StoredScan {
  nlohmann::json status;         ///< Of the appliance, after the scan.
  std::filesystem::path folder;  ///< Of the scan; with its recording.
};

/// @param loop  Made before any thread starts: it blocks signals.
/// @param frames  The sweep ends after so many.
inline StoredScan ScanWith(EventLoop& loop, const SensorSetup& setup, const Config& config,
                           int frames) {
  ApplianceParts parts;
  parts.config = config;
  parts.make_provider = [&] { return setup.MakeProvider(); };
  parts.before_scan = [&] { setup.BeforeScan(); };
  parts.demo_patient = "demo";
  SharedParts shared(loop, parts);
  Appliance appliance(shared);
  Settings settings;
  settings.keep_recordings = true;
  shared.store->settings.Change({.user = "tester", .address = {}}, settings);

  enum class Step { kAwaitSensor, kSweep, kAwaitResult, kDone } step = Step::kAwaitSensor;
  StoredScan stored;
  const Actor tester{.user = "tester", .address = {}};
  const auto advance = [&] {
    const ApplianceState phase = appliance.state().phase;
    stored.status = appliance.StatusJson();
    if (step == Step::kAwaitSensor && phase == ApplianceState::kReady) {
      step = Step::kSweep;
      EXPECT_EQ(appliance.StartSweep(tester).English(), "");
    } else if (step == Step::kSweep && phase == ApplianceState::kScanning &&
               stored.status["scan"].value("frames", 0) >= frames) {
      step = Step::kAwaitResult;
      EXPECT_EQ(appliance.EndSweep(tester).English(), "");
    } else if (step != Step::kAwaitSensor && phase == ApplianceState::kResult) {
      // If frames are processed slowly, as under a sanitizer, the sweep may end by itself.
      step = Step::kDone;
      loop.Quit(0);
    }
  };
  // Not within the appliance's own call: what follows changes its state.
  shared.notices.SetPage([&](web::EventKind) { loop.Post("test", advance); });
  loop.Post("test", advance);
  EventLoop::Source too_late = loop.MakeTimer("test", [&] {
    ADD_FAILURE() << "no result within four minutes: " << stored.status.dump();
    loop.Quit(1);
  });
  too_late.ArmAfter(std::chrono::minutes(4));
  loop.Run();
  shared.notices.SetPage({});
  if (stored.status["last_result"].is_object())
    stored.folder =
        config.appliance.state / "scans" / stored.status["last_result"]["scan"].get<std::string>();
  return stored;
}

}  // namespace plumb::testing
