// SPDX-License-Identifier: Apache-2.0
// From what a sweep shows to what is wrong with it: one place that names causes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/diagnosis/foreign_markers.hpp"
#include "algo/diagnosis/marker_depth.hpp"
#include "algo/diagnosis/stream_offset.hpp"

namespace plumb {

/// How far the sweep moved the sensor's calibration from what was known before.
struct CalibrationFit {
  double chi2 = 0.0;  ///< (x - mean)' information (x - mean) of the prior.
  int num_terms = 0;  ///< 0: nothing was calibrated.
  /// The term that is farthest from its prior, in standard deviations of the prior.
  std::string worst_term;  ///< As in CalibrationNames(), with its unit.
  double worst_value = 0.0;
  double worst_sigma = 0.0;  ///< Of the prior.
  double delay_s = 0.0;      ///< Of depth, from its prior; < 0: depth lags behind colour.
};

/// What one sweep shows. A quantity that was not measured stays absent or zero, and no finding is
/// made of it.
struct Symptoms {
  std::vector<MarkerDepth> marker_depths;  ///< By id.
  DepthLayout depth_layout = DepthLayout::kAsStated;
  double marker_length_m = 0.0;        ///< As stated.
  bool depth_unit_assumed = false;     ///< Nothing states the unit of the depth images.
  double depth_units_per_metre = 0.0;  ///< The unit that was taken; 0: not known.
  bool cameras_assumed = false;        ///< Nothing states the intrinsics.
  bool depth_camera_unknown = false;   ///< See StreamInfo.
  double focal_px = 0.0;               ///< Of the colour camera, as stated or assumed.
  std::optional<StreamOffset> stream_offset;
  std::int64_t num_frames = 0;
  std::int64_t num_repeated_depth = 0;  ///< Depth images with every pixel of the one before.
  std::int64_t num_repeated_color = 0;
  double share_near = 0.0;      ///< Fraction of the measured depth that is nearer than usable.
  double share_far = 0.0;       ///< Fraction of the measured depth that is farther than usable.
  double median_gray = 128;     ///< Of the images' mean values, 0 to 255.
  double share_white = 0.0;     ///< Fraction of the colour images' pixels that are saturated.
  double share_flickers = 0.0;  ///< Fraction of the images that differ in brightness from the last.
  double widths_per_s = 0.0;    ///< Median speed of what the colour images show.
  double nearest_m = 0.0;       ///< The usable range.
  double farthest_m = 0.0;
  std::optional<ForeignMarkers> foreign_markers;  ///< Only where no marker was decoded.
  CalibrationFit calibration;
};

enum class FindingLevel {
  kWarning,  ///< The scene may be compared; who reads the result has to know.
  kRefusal   ///< The scene must not be compared.
};

/// One cause. Where the evidence fits several, the message names them all: "either ... or ...".
struct Finding {
  FindingLevel level = FindingLevel::kWarning;
  Message message;  ///< Its id is the cause.
};

/// Fraction by which the scene's lengths may be wrong, because the depth and the stated size of the
/// markers disagree by more than such sensors usually do: the disagreement, and 1 % that the sensor
/// may be off in the other direction. 0 if they agree or nothing was measured.
[[nodiscard]] double ScaleDoubt(const Symptoms& symptoms);

/// Whether a refusal says that the assumed cameras do not fit. Lengths are then off by several per
/// cent, so no scene is made of a recording.
[[nodiscard]] bool IsOfAssumedCameras(const Message& refusal);

/// The causes, the most serious first. A pure function of its input.
///
/// A cause that explains a symptom of another one suppresses it: where depth has another unit than
/// stated, the calibration that the solve then finds means nothing.
[[nodiscard]] std::vector<Finding> Diagnose(const Symptoms& symptoms);

}  // namespace plumb
