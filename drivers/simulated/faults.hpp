// What can be wrong with a simulated sensor, its hand and its room: named, and switched one by one.
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

namespace plumb::simulated {

enum class NoiseLevel { kIdeal, kNominal, kHard };

/// "ideal", "nominal" or "hard".
[[nodiscard]] std::string_view ToString(NoiseLevel noise);

/// Every fault. `drivers/simulated/README.md` has the ranges and where they come from.
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

/// One of them, for people.
struct FaultEntry {
  Fault fault;
  std::string_view name;   ///< As the command line has it.
  std::string_view about;  ///< One line.
};

/// All of them, in the order of the enumeration.
[[nodiscard]] std::span<const FaultEntry, kNumFaults> AllFaults();
[[nodiscard]] std::optional<Fault> ParseFault(std::string_view name);

/// Which faults are on.
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

/// What is wrong with every real unit in a real hand (nominal), and more of it (hard). Ideal: none.
[[nodiscard]] FaultSet FaultsOf(NoiseLevel level);

/// Only the faults whose shape the method's own sensor model has: the unit that the virtual sensor
/// plays. Ideal: none.
[[nodiscard]] FaultSet MildFaults(NoiseLevel level);

}  // namespace plumb::simulated
