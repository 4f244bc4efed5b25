// SPDX-License-Identifier: Apache-2.0
// Use of a sensor unit's profile by one scan: its start values, and what the profile learns from
// it.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "algo/sensor_calibration/profile_gate.hpp"
#include "algo/types/scene.hpp"
#include "daemon/sensor_profiles/profile_shelf.hpp"

namespace plumb {

/// Used by the scan's thread only. Nothing here throws: a scan does not fail because of its
/// profile.
class UnitProfile {
 public:
  /// @param stated  Intrinsics stated by the sensor's streams; a profile for others is not used.
  UnitProfile(std::shared_ptr<ProfileShelf> shelf, std::string serial, Intrinsics stated);

  /// Reads the profile, widened by its age, into the options, and requests the updated profile from
  /// the reconstruction.
  void Begin(ReconstructorOptions& options);

  /// Called after the sweep. Empty if it agrees with the profile, there is none, or nothing was
  /// learned; otherwise that the unit has changed, and what to do.
  [[nodiscard]] Message Drift() const;

  /// Adds a new version from a sweep that passed its checks, unless Drift() reports a change.
  void LearnFromScan();

 private:
  [[nodiscard]] std::optional<ProfileAgreement> Compared() const;

  std::shared_ptr<ProfileShelf> shelf_;
  std::string serial_;
  Intrinsics stated_;
  std::optional<SensorProfile> before_, learned_;
  int begun_from_ = 0;
};

}  // namespace plumb
