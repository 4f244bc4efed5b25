// SPDX-License-Identifier: Apache-2.0
// What an appliance is made of.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "daemon/config/config.hpp"
#include "daemon/storage/storage_watch.hpp"
#include "drivers/button.hpp"
#include "drivers/indicator.hpp"
#include "drivers/sensor.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// Dependencies of an appliance. Borrowed objects live longer than it.
struct ApplianceParts {
  Config config;
  std::optional<std::filesystem::path> config_file = {};  ///< Where it was read; nothing: nowhere.
  std::function<std::unique_ptr<SensorProvider>()> make_provider;  ///< Called on the sensor thread.
  std::function<void()> before_scan;                               ///< See SensorThreadOptions.
  Button* button = nullptr;  ///< Null: presses come from elsewhere only.
  Indicator* indicator = nullptr;
  /// The patient of the session that is open from the start; its first scan becomes its reference,
  /// approved by "auto". Empty: scans belong to no patient until a session is opened.
  std::string demo_patient;
  double result_s = kResultValid_s;  ///< Time for which a result is shown.
  /// Time without progress after which a working thread counts as hung. The longest single steps
  /// take a few seconds: opening a sensor on a slow bus, and comparing two large scenes.
  double sensor_silence_s = 30.0;
  double worker_silence_s = 30.0;
  StorageOptions storage = {};  ///< Its state folder is that of the configuration.
  /// Unit of the intervals between checks, removals and backups.
  std::chrono::milliseconds tick{1000};
  std::chrono::milliseconds clock_trusted_after = std::chrono::hours(1);  ///< See StorageUpkeep.
  RemovalRules removal_rules = {};
};

}  // namespace plumb
