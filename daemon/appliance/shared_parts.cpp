// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/shared_parts.hpp"

#include <utility>

namespace plumb {
namespace {

StorageOptions StorageOf(const ApplianceParts& parts) {
  StorageOptions options = parts.storage;
  options.state = parts.config.appliance.state;
  return options;
}

}  // namespace

SharedParts::SharedParts(EventLoop& its_loop, ApplianceParts its_parts)
    : loop(its_loop),
      given(std::move(its_parts)),
      notices([this] { upkeep.CountAgain(); }),
      storage(loop, StorageOf(given), store_thread, check_thread),
      store(storage.store()),
      upkeep(
          loop, storage, given.config, [this](web::EventKind kind) { notices.TellPage(kind); },
          given.clock_trusted_after, given.removal_rules, store_thread, check_thread),
      room(store, given.config, [this] { return sensors.snapshot(); }),
      profiles(given.config, [this] { return sensors.snapshot(); }),
      references(store, given.config, !given.demo_patient.empty(),
                 [this] { return sensors.snapshot(); }),
      session(loop, given.config, [this] { session_unused(); }),
      sensors(given.make_provider,
              SensorThreadOptions{.serial = given.config.appliance.sensor_serial,
                                  .before_scan = given.before_scan},
              [this](const SensorEvent& event) {
                loop.Post("sensor", [this, event] { sensor_changed(event); });
              }) {}

}  // namespace plumb
