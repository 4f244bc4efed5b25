// One scan's use of what is known of its sensor unit: where it begins, and what it teaches.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "algo/acceptance/acceptance.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "algo/sensor_model/profile_gate.hpp"
#include "algo/types/scene.hpp"
#include "daemon/records/profile_shelf.hpp"

namespace plumb {

/// Used by the scan's thread alone. Nothing here throws: a scan does not fail for its profile.
class UnitProfile {
 public:
  /// @param stated  What the sensor's streams state; a profile of other intrinsics is not used.
  UnitProfile(std::shared_ptr<ProfileShelf> shelf, std::string serial, Intrinsics stated);

  /// Reads the profile, widened by its age, into the options, and asks the reconstruction for what
  /// the sweep will have learned.
  void Begin(ReconstructorOptions& options);

  /// After the sweep. Empty: it agrees with the profile, or there is none, or it has learned
  /// nothing; else that the unit has changed and what to do, as a sentence.
  [[nodiscard]] std::string Drift() const;

  /// Adds what a sweep that passed its checks has learned as a new version, unless Drift().
  void Teach();

 private:
  [[nodiscard]] std::optional<ProfileAgreement> Compared() const;

  std::shared_ptr<ProfileShelf> shelf_;
  std::string serial_;
  Intrinsics stated_;
  std::optional<SensorProfile> before_, learned_;
  int begun_from_ = 0;
};

/// Why a scan that ended teaches nothing of its sensor; empty: it may. The gates that a scene alone
/// can be held against are the comparison's.
/// @param verdict  Of its comparison or check, if there was one.
[[nodiscard]] std::string WhyItTeachesNothing(const Scene& scene,
                                              const std::optional<Verdict>& verdict,
                                              const AcceptanceLimits& limits);

}  // namespace plumb
