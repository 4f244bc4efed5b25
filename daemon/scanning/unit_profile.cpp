// SPDX-License-Identifier: Apache-2.0
#include "daemon/scanning/unit_profile.hpp"

#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"
#include "words/scan.hpp"

namespace plumb {

UnitProfile::UnitProfile(std::shared_ptr<ProfileShelf> shelf, std::string serial, Intrinsics stated)
    : shelf_(std::move(shelf)), serial_(std::move(serial)), stated_(std::move(stated)) {}

void UnitProfile::Begin(ReconstructorOptions& options) {
  try {
    ProfileShelf::InUse in_use = shelf_->Read(serial_);
    begun_from_ = in_use.version;
    if (!in_use.fault.empty()) Log(LogLevel::kError, in_use.fault.English(), {{"SERIAL", serial_}});
    if (in_use.newest && in_use.newest->profile && in_use.newest->profile->stated != stated_) {
      Log(LogLevel::kWarning,
          fmt::format("the profile of sensor {} belongs to another calibration file: it is not "
                      "used, and a new one is learned",
                      serial_),
          {{"SERIAL", serial_}});
    } else if (in_use.newest && in_use.newest->profile) {
      using Days = std::chrono::duration<double, std::ratio<86400>>;
      const Days age = std::chrono::system_clock::now() - in_use.newest->made;
      // In whole days, so that a recording that is processed again on the same day gives the same
      // scene.
      before_ = Aged(*in_use.newest->profile, std::floor(age.count()));
      // The covariance is checked here, where a scan can still proceed without the profile.
      (void)PriorOfNextSweep(*before_, stated_, CalibrationModel::kEdgeBiasSigma);
    }
  } catch (const std::exception& error) {
    before_.reset();
    Log(LogLevel::kError,
        fmt::format("the profile of sensor {} is not used: {}", serial_, error.what()),
        {{"SERIAL", serial_}});
  }
  options.profile = before_;
  options.on_learned = [this](const SensorProfile& profile) { learned_ = profile; };
}

std::optional<ProfileAgreement> UnitProfile::Compared() const {
  if (!before_ || !learned_) return std::nullopt;
  try {
    return Agreement(*before_, *learned_);
  } catch (const std::exception&) {  // Begin() has checked the covariance
    return std::nullopt;
  }
}

Message UnitProfile::Drift() const {
  const std::optional<ProfileAgreement> compared = Compared();
  if (!compared || compared->agrees()) return {};
  return say::scan::ProfileDrift(serial_, compared->chi_square, compared->limit,
                                 compared->num_terms);
}

void UnitProfile::LearnFromScan() {
  if (!learned_) return;
  if (const Message drift = Drift(); !drift.empty()) {
    Log(LogLevel::kWarning, drift.English() + "; this sweep was not joined with it",
        {{"SERIAL", serial_}});
    return;
  }
  try {
    const std::optional<ProfileAgreement> compared = Compared();
    const int version = shelf_->Add(serial_, *learned_, begun_from_);
    Log(LogLevel::kInfo,
        fmt::format("the profile of sensor {} has version {} now, from {} sweep{}{}", serial_,
                    version, learned_->num_sweeps, learned_->num_sweeps == 1 ? "" : "s",
                    compared ? fmt::format(" (chi-square {:.1f}, at most {:.1f})",
                                           compared->chi_square, compared->limit)
                             : std::string()),
        {{"SERIAL", serial_}});
  } catch (const std::exception& error) {
    Log(LogLevel::kError,
        fmt::format("the update of sensor {}'s profile by this sweep is lost: {}", serial_,
                    error.what()),
        {{"SERIAL", serial_}});
  }
}

}  // namespace plumb
