// SPDX-License-Identifier: Apache-2.0
// What the page may ask of the appliance and what it is refused, as tests over HTTP that run on the
// real services with their store and on the fake that other tests of the page use: so the fake
// keeps to the same rules. Each program that has these tests says which it is by
// MakeRuledAppliance().
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace plumb::test {

/// Serves until destroyed, with cheap passwords. Its functions may be called from any thread.
class RuledAppliance {
 public:
  virtual ~RuledAppliance() = default;
  [[nodiscard]] virtual std::uint16_t port() const = 0;
  [[nodiscard]] virtual std::string setup_code() const = 0;
  /// A scan of the patient that was finished a moment ago and compared with nothing; its id.
  virtual std::string StoreScan(const std::string& patient_id) = 0;
  /// A daily check of the connected sensor that has passed just now, taken by that person; its id.
  virtual std::string PassDailyCheck(const std::string& user) = 0;
  /// A daily check that also saw the board of the room's calibration.
  virtual void ScanBoard() = 0;
  /// The connected sensor, whose serial number is "A", gets a profile from four sweeps.
  virtual void LearnProfile() = 0;
};

[[nodiscard]] std::unique_ptr<RuledAppliance> MakeRuledAppliance();

}  // namespace plumb::test
