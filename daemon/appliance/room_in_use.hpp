// SPDX-License-Identifier: Apache-2.0
// The axes of the room that are in use: those of the signed calibration.
#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/comparison/body_parts.hpp"
#include "daemon/config/config.hpp"
#include "daemon/scanning/scan_session.hpp"
#include "daemon/storage/current_store.hpp"
#include "daemon/sweep/sensor_thread.hpp"
#include "web/model/status.hpp"
#include "web/service/room_services.hpp"

namespace plumb {

/// Used on the loop's thread, except for functions marked "from any thread".
class RoomInUse {
 public:
  /// Store and configuration are borrowed and outlive this object, and so does what `sensor` uses.
  RoomInUse(const CurrentStore& store, const Config& config,
            std::function<SensorSnapshot()> sensor);

  /// Reloads the calibration, and whether a marker has moved since.
  void Refresh();
  /// For the comparison of the next scan.
  [[nodiscard]] std::optional<RoomAxes> OfJob() const;
  /// The room's axes on the maps of a scene, as a comparison with it would find them; not set if
  /// the room is not known. From any thread.
  [[nodiscard]] std::optional<Pose> AxesIn(const MarkerMap& scene) const;
  /// Where the gantry is on the maps of a scene, as a comparison with it would find it; not set if
  /// the room is not known. From any thread.
  /// @param scene  Its markers: the reference marker may have lain otherwise than when the room
  ///         was calibrated.
  [[nodiscard]] std::optional<RoomWays> In(const MarkerMap& scene) const;
  /// Where the lasers cross in the frame of that scene: the origin of the calibration's axes. Not
  /// set without a calibration that holds. From any thread.
  [[nodiscard]] std::optional<Eigen::Vector3d> LasersIn(const MarkerMap& scene) const;
  void Report(Status& status) const;
  /// From any thread.
  [[nodiscard]] web::RoomCalibrationStatus Calibration() const;
  /// The board for the room's markers; from any thread.
  [[nodiscard]] std::string BoardPdf() const;
  /// Whose scans of the board count for the next calibration, and since when; from any thread.
  [[nodiscard]] std::pair<std::string, WallClock::time_point> ScansWanted() const;

 private:
  [[nodiscard]] std::optional<Pose> T_iec_reference() const;

  /// The calibration in use, as found by Refresh().
  struct Room {
    std::optional<SignedRoom> calibration;
    Message due;  ///< Set without a calibration: one is stored but cannot be read.
    std::optional<Pose> configured;  ///< T_iec_reference of the configuration.
  };

  const CurrentStore& store_;
  const Config& config_;
  const std::function<SensorSnapshot()> sensor_;
  mutable std::mutex mutex_;  ///< For the room: changed on the loop, read from any thread.
  Room room_;
};

/// Why a calibration is too old to join a scan with what shares no marker with it: a planning CT, a
/// scan of another room. Empty if it is not.
/// @param most_days  0: it never is.
[[nodiscard]] Message WhyTooOld(WallClock::time_point signed_at, WallClock::time_point now,
                                double most_days);

/// The room of another unit without a calibration that is too old, see WhyTooOld().
[[nodiscard]] std::optional<ImportedRoom> UnlessTooOld(std::optional<ImportedRoom> room,
                                                       WallClock::time_point now, double most_days);

/// Midnight, local time.
[[nodiscard]] WallClock::time_point StartOfDay();

}  // namespace plumb
