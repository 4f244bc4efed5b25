// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/shared_parts.hpp"

#include <utility>

#include "daemon/unit/page_identity.hpp"

namespace plumb {
namespace {

StorageOptions StorageOf(const ApplianceParts& parts) {
  StorageOptions options = parts.storage;
  options.state = parts.config.appliance.state;
  return options;
}

OccasionRules RulesOf(const Config& config) {
  return {.check_due_min = config.messages.check_due_min,
          .check_on_weekends = config.messages.check_on_weekends,
          .backup_hours = config.appliance.backup_hours,
          .makes_backups = !config.appliance.backup_folder.empty()};
}

}  // namespace

SharedParts::SharedParts(EventLoop& its_loop, ApplianceParts its_parts)
    : loop(its_loop),
      given(std::move(its_parts)),
      notices([this] { upkeep.RecountUnusable(); }),
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
      messages(loop, given.config.messages, RulesOf(given.config),
               [this] { notices.TellPage(web::EventKind::kStatus); }),
      peers(loop, given.config.peers, AccessToken(given.config.peers.secret_file),
            [this](const Message& found) { peers_changed(found); }),
      sensors(given.make_provider,
              SensorThreadOptions{.serial = given.config.appliance.sensor_serial,
                                  .second_serial = given.config.appliance.second_sensor_serial,
                                  .before_scan = given.before_scan},
              [this](const SensorEvent& event) {
                loop.Post("sensor", [this, event] { sensor_changed(event); });
              }) {}

}  // namespace plumb
