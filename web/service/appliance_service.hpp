// SPDX-License-Identifier: Apache-2.0
// The state of the appliance, and the functions of its button.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/outlined_picture.hpp"
#include "web/model/status.hpp"

namespace plumb::web {

enum class EventKind {
  kStatus,    ///< State, sensor, light, storage: ask GetStatus().
  kProgress,  ///< A scan goes on: ask GetStatus().
  kResult,    ///< A scan ended: ask GetStatus().
  kData,      ///< Patients, references, scans, users or settings changed.
  kUpdate,    ///< Ask GetUpdate().
  kMonitor,   ///< Ask MonitoringService::GetMonitor().
};

/// The rules of services.hpp hold.
class ApplianceService {
 public:
  virtual ~ApplianceService() = default;

  [[nodiscard]] virtual Status GetStatus() = 0;
  [[nodiscard]] virtual Health GetHealth() = 0;
  /// The newest camera picture as a small JPEG (at most 320 pixels wide, at most 5 per second);
  /// null when the sensor delivers none.
  [[nodiscard]] virtual std::shared_ptr<const std::string> Preview() = 0;
  /// Makes a JPEG of the newest camera picture, in all its pixels up to 1280 columns, and at most
  /// kMaxPhoto bytes if that is possible; on any thread. Empty when the sensor delivers none.
  [[nodiscard]] virtual std::function<std::string()> Photographer() = 0;
  /// A picture twice a second with the outline of the reference that the open session compares
  /// with, as long as somebody asks; nothing without such a reference, during a daily check, and
  /// when the sensor delivers no picture.
  [[nodiscard]] virtual std::optional<CameraOutline> Outline() = 0;
  /// The surface seen so far by the sweep, from above, in the encoding of
  /// daemon/files/compact_map.hpp: cells of 2 cm around the reference marker, 32767 where the
  /// region was not seen yet. Null without a sweep, and until that marker has been seen.
  [[nodiscard]] virtual std::shared_ptr<const std::string> SweptSurface() = 0;
  /// Like a short press of the button: starts a scan, ends the sweep, dismisses a result. kConflict
  /// if it is ignored.
  virtual void Press(const Actor& actor, Done done) = 0;
  /// The same for one purpose each, so that a repeated request does not do the other: kConflict in
  /// other states.
  virtual void StartSweep(const Actor& actor, Done done) = 0;
  virtual void EndSweep(const Actor& actor, Done done) = 0;
  /// Like a long press: discards the scan.
  virtual void Cancel(const Actor& actor, Done done) = 0;
  /// Called on the loop thread. One listener; an empty function removes it.
  virtual void SetListener(std::function<void(EventKind)> listener) = 0;
};

}  // namespace plumb::web
