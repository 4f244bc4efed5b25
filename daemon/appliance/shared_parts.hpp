// SPDX-License-Identifier: Apache-2.0
// What the appliance shares with the services beside it.
#pragma once

#include <functional>

#include "daemon/appliance/appliance_parts.hpp"
#include "daemon/appliance/current_session.hpp"
#include "daemon/appliance/live_monitoring.hpp"
#include "daemon/appliance/notices.hpp"
#include "daemon/appliance/reference_gate.hpp"
#include "daemon/appliance/room_in_use.hpp"
#include "daemon/appliance/unit_profiles.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"
#include "daemon/messages_out/messages_out.hpp"
#include "daemon/monitoring/outline_watch.hpp"
#include "daemon/peers/peer_watch.hpp"
#include "daemon/storage/storage_upkeep.hpp"
#include "daemon/storage/storage_watch.hpp"
#include "daemon/sweep/sensor_thread.hpp"

namespace plumb {

/// Made before the appliance and destroyed after it. Whoever makes both gives each service the
/// parts that it needs. The loop must not run without the appliance.
struct SharedParts {
  SharedParts(EventLoop& its_loop, ApplianceParts its_parts);
  SharedParts(const SharedParts&) = delete;
  SharedParts& operator=(const SharedParts&) = delete;

  EventLoop& loop;
  ApplianceParts given;  ///< The appliance changes its configuration when that is read again.
  /// Called on the loop; set by the appliance.
  std::function<void(const SensorEvent&)> sensor_changed;
  std::function<void()> session_unused;
  std::function<void(const Message& found)> peers_changed;
  Message not_archived;  ///< Why accepted results wait for the archive; empty: none does.
  Notices notices;
  StorageWatch storage;       ///< Opened by the appliance.
  const CurrentStore& store;  ///< In safe mode a read-only one, or none. From any thread.
  StorageUpkeep upkeep;
  RoomInUse room;
  UnitProfiles profiles;
  ReferenceGate references;
  CurrentSession session;
  WorkThread store_thread{256};  ///< Changes of the store, one after the other, off the loop.
  LiveMonitoring monitoring{loop, notices, store_thread};
  MessagesOut messages;
  PeerWatch peers;
  WorkThread check_thread{4};  ///< Reads stored files; changes do not wait for it.
  SensorThread sensors;        // its events use the members above
  OutlineWatch outline{sensors};
};

}  // namespace plumb
