// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/faults.hpp"

#include <algorithm>

namespace plumb::simulated {
namespace {

// The lowest level that has a fault; kOnRequest: no level has it.
enum class Since : std::uint8_t { kMild, kNominal, kHard, kOnRequest };

struct Row {
  FaultEntry entry;
  Since since;
};

constexpr std::array<Row, kNumFaults> kRows = {{
    {{Fault::kCalibration, "calibration",
      "camera.yaml and the registration of depth to colour are slightly wrong"},
     Since::kMild},
    {{Fault::kDepthScale, "depth-scale", "scale, offset, bow and slopes of the depth image"},
     Since::kMild},
    {{Fault::kDepthNoise, "depth-noise", "axial and lateral noise of depth, correlated"},
     Since::kMild},
    {{Fault::kQuantisation, "quantisation", "depth in the PS1080's steps of disparity"},
     Since::kMild},
    {{Fault::kShadow, "shadow", "no depth where the projector does not reach"}, Since::kMild},
    {{Fault::kDropouts, "dropouts", "lost pixels, grazing losses, flying pixels at edges"},
     Since::kMild},
    {{Fault::kRollingShutter, "rolling-shutter", "both cameras read their rows one by one"},
     Since::kMild},
    {{Fault::kMotionBlur, "motion-blur", "the colour camera's exposure takes time"}, Since::kMild},
    {{Fault::kDelays, "delays", "depth is taken later than colour; stamps err and jitter"},
     Since::kMild},
    {{Fault::kOptics, "optics", "the lens blurs and darkens the corners"}, Since::kMild},
    {{Fault::kImageNoise, "image-noise", "shot noise and read noise of the colour image"},
     Since::kMild},
    {{Fault::kJpeg, "jpeg", "colour images of recordings are JPEG"}, Since::kMild},
    {{Fault::kDepthField, "depth-field", "the depth image is bent by a smooth random field"},
     Since::kNominal},
    {{Fault::kDepthFieldChange, "depth-field-change", "the field changes its shape with depth"},
     Since::kNominal},
    {{Fault::kDepthRadial, "depth-radial", "depth errs with the distance from the image's middle"},
     Since::kNominal},
    {{Fault::kToneCurve, "tone-curve",
      "colour values follow the unit's own curve: linear, a power, sRGB or S-shaped"},
     Since::kNominal},
    {{Fault::kTremble, "tremble", "the hand trembles by 4 mm and 0.4 deg RMS over 1 to 10 Hz"},
     Since::kNominal},
    {{Fault::kLensTangential, "lens-tangential",
      "the colour lens is more decentred than camera.yaml says"},
     Since::kNominal},
    {{Fault::kLensHigher, "lens-higher", "lens terms that camera.yaml has no place for"},
     Since::kNominal},
    {{Fault::kSpeckle, "speckle", "depth errors that stay with the projected pattern"},
     Since::kNominal},
    {{Fault::kWarmUp, "warm-up", "depth drifts by the minute while the unit warms up"},
     Since::kNominal},
    {{Fault::kExposureSteps, "exposure-steps", "automatic exposure changes in steps"},
     Since::kHard},
    {{Fault::kWhiteBalance, "white-balance", "automatic white balance changes in steps"},
     Since::kHard},
    {{Fault::kLostFrames, "lost-frames", "one pair of images in 25 is missing"}, Since::kHard},
    {{Fault::kDoubledFrames, "doubled-frames",
      "one pair in 50 is the one before, with a new stamp"},
     Since::kHard},
    {{Fault::kGlare, "glare", "glossy prints mirror the ceiling's lights"}, Since::kHard},
    {{Fault::kPrintScale, "print-scale", "all prints are up to 0.5 % too large or too small"},
     Since::kHard},
    {{Fault::kCurledPrints, "curled-prints", "prints bulge by up to 2.5 mm between their sides"},
     Since::kHard},
    {{Fault::kMovedMarker, "moved-marker",
      "in every scene but the first, one marker was moved by 6 to 20 mm"},
     Since::kOnRequest},
    {{Fault::kMovingMarker, "moving-marker",
      "one marker is pushed by 10 to 30 mm during every sweep"},
     Since::kOnRequest},
    {{Fault::kCable, "cable", "the sensor's cable hangs into its view"}, Since::kOnRequest},
    {{Fault::kHand, "hand", "a hand reaches into the view for a second of every sweep"},
     Since::kOnRequest},
    {{Fault::kBreathing, "breathing", "chest and belly rise and fall during the sweep"},
     Since::kOnRequest},
}};

constexpr std::array<FaultEntry, kNumFaults> kEntries = [] {
  std::array<FaultEntry, kNumFaults> entries{};
  for (std::size_t i = 0; i < kNumFaults; ++i) entries[i] = kRows[i].entry;
  return entries;
}();
static_assert(
    [] {
      for (std::size_t i = 0; i < kNumFaults; ++i) {
        if (kEntries[i].fault != static_cast<Fault>(i)) return false;
      }
      return true;
    }(),
    "in the order of the enumeration");

FaultSet Up(Since last) {
  FaultSet faults;
  for (const Row& row : kRows) faults.Set(row.entry.fault, row.since <= last);
  return faults;
}

}  // namespace

std::span<const FaultEntry, kNumFaults> AllFaults() { return kEntries; }

std::optional<Fault> ParseFault(std::string_view name) {
  const auto found = std::find_if(kEntries.begin(), kEntries.end(),
                                  [&](const FaultEntry& entry) { return entry.name == name; });
  if (found == kEntries.end()) return std::nullopt;
  return found->fault;
}

std::vector<std::string> FaultSet::Names() const {
  std::vector<std::string> names;
  for (const FaultEntry& entry : kEntries) {
    if (Has(entry.fault)) names.emplace_back(entry.name);
  }
  return names;
}

FaultSet FaultsOf(NoiseLevel level) {
  if (level == NoiseLevel::kIdeal) return {};
  return Up(level == NoiseLevel::kHard ? Since::kHard : Since::kNominal);
}

FaultSet MildFaults(NoiseLevel level) {
  return level == NoiseLevel::kIdeal ? FaultSet{} : Up(Since::kMild);
}

}  // namespace plumb::simulated
