// SPDX-License-Identifier: Apache-2.0
// Faults of a simulated sensor, its operator and its room, each with a name and a switch.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "algo/base/names.hpp"

namespace plumb::simulated {

enum class NoiseLevel { kIdeal, kNominal, kHard };

/// Every fault. `drivers/simulator/README.md` has the ranges and their sources.
enum class Fault : std::uint8_t {
  kCalibration,
  kDepthScale,
  kDepthNoise,
  kQuantisation,
  kShadow,
  kDropouts,
  kRollingShutter,
  kMotionBlur,
  kDelays,
  kOptics,
  kImageNoise,
  kJpeg,
  kDepthField,
  kDepthFieldChange,
  kDepthRadial,
  kToneCurve,
  kTremble,
  kLensTangential,
  kLensHigher,
  kSpeckle,
  kWarmUp,
  kExposureSteps,
  kWhiteBalance,
  kLostFrames,
  kDoubledFrames,
  kGlare,
  kPrintScale,
  kCurledPrints,
  kMovedMarker,
  kMovingMarker,
  kCable,
  kHand,
  kBreathing,
};
inline constexpr std::size_t kNumFaults = 33;

/// Description of one fault.
struct FaultEntry {
  Fault fault;
  std::string_view name;   ///< Name on the command line.
  std::string_view about;  ///< One line of description.
};

/// All of them, in the order of the enumeration.
[[nodiscard]] std::span<const FaultEntry, kNumFaults> AllFaults();
[[nodiscard]] std::optional<Fault> ParseFault(std::string_view name);

/// The set of active faults.
class FaultSet {
 public:
  [[nodiscard]] bool Has(Fault fault) const { return bits_.test(static_cast<std::size_t>(fault)); }
  void Set(Fault fault, bool on) { bits_.set(static_cast<std::size_t>(fault), on); }
  [[nodiscard]] FaultSet With(Fault fault, bool on = true) const {
    FaultSet changed = *this;
    changed.Set(fault, on);
    return changed;
  }
  [[nodiscard]] std::vector<std::string> Names() const;
  bool operator==(const FaultSet&) const = default;

 private:
  std::bitset<kNumFaults> bits_;
};

/// The faults of every real unit and operator (nominal), and additional ones (hard). Ideal: none.
[[nodiscard]] FaultSet FaultsOf(NoiseLevel level);

/// Only faults that the method's own sensor model can represent, as used by the virtual sensor.
/// Ideal: none.
[[nodiscard]] FaultSet MildFaults(NoiseLevel level);

}  // namespace plumb::simulated

template <>
inline constexpr auto plumb::kNamesOf<plumb::simulated::NoiseLevel> =
    plumb::NamesUpTo<plumb::simulated::NoiseLevel::kHard>({"ideal", "nominal", "hard"});
