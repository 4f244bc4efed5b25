// SPDX-License-Identifier: Apache-2.0
// One simulated sensor: its true optics and errors, and the calibration stated for it.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "algo/base/intrinsics.hpp"
#include "algo/base/names.hpp"
#include "algo/base/pose.hpp"
#include "algo/sensor_model/depth_sensor.hpp"
#include "drivers/simulator/sensor/faults.hpp"

namespace plumb::simulated {

/// Depth distortion beyond the terms of the method's sensor model. The relative error of depth is
/// radial_error(r) + field_rms f(x, y) + change_rms g(x, y) s(z): f and g are two SmoothField()s,
/// s(z) = d / (1 + |d|) with d = (z - 0.9 m) / 0.4 m.
struct DepthBend {
  double radial = 0.0;          ///< At the corner of the image.
  double radial_quartic = 0.0;  ///< Fraction of it that grows with r^4 instead of r^2, 0 to 1.
  double field_rms = 0.0;
  double change_rms = 0.0;
  std::uint64_t field_seed = 0;
  std::uint64_t change_seed = 0;
};

/// Distortion of the colour lens beyond OpenCV's five terms, in normalised coordinates, added to
/// their result: x += s1 r^2 + s2 r^4, y += s3 r^2 + s4 r^4 (thin prism), and the radial factor k4
/// r^8.
struct LensRest {
  std::array<double, 4> prism{};
  double k4 = 0.0;
  /// In place of OpenCV's terms: the coefficients of an equidistant lens, of which the unit's
  /// Intrinsics have only what comes near.
  std::optional<std::array<double, 4>> equidistant = std::nullopt;
  bool operator==(const LensRest&) const = default;
};

/// From linear light to a fraction of the largest code, both 0 to 1, increasing.
struct ToneCurve {
  enum class Kind : std::uint8_t { kLinear, kPower, kSrgb, kSShaped };
  Kind kind = Kind::kSrgb;
  double gamma = 2.2;   ///< kPower and kSShaped: light^(1/gamma).
  double contrast = 0;  ///< kSShaped: fraction of a smooth step that is mixed in, below 1.

  [[nodiscard]] double Encode(double light) const;
};

/// A unit's own curve: linear, a power of 1.6 to 2.8, sRGB or S-shaped, each for a quarter of the
/// units.
[[nodiscard]] ToneCurve DrawToneCurve(std::uint64_t seed);

/// Errors of the classes other than structured light; each class has some of them. Pixels are
/// those of an image of 640 columns.
struct ClassErrors {
  // Stereo: the disparity is baseline * focal length / z.
  double baseline_m = 0.0;
  double disparity_px = 0.0;       ///< Constant error.
  double disparity_tilt_px = 0.0;  ///< Its change from the centre to the right border.
  double ripple_px = 0.0;          ///< Of the interpolation between whole pixels.
  double noise_px = 0.0;
  int fatten_px = 0;  ///< How far a nearer surface reaches over its border.
  // Time of flight and range finders.
  double offset_m = 0.0;
  double wiggle_m = 0.0, wiggle_phase = 0.0;
  double multipath = 0.0;  ///< Share of a hollow's depth that light from its walls adds.
  double skin_m = 0.0;     ///< By which skin appears farther.
  double noise_m = 0.0;    ///< At the distance 0; grows with its square.
  double wander_m = 0.0, wander_rad = 0.0;  ///< Offset and tilt from image to image.
  double correlation_px = 0.0;              ///< As SensorUnit::correlation_px.
};

/// A unit of the Xtion class with projector, infrared camera and colour camera at different
/// positions, or of another class. Lengths in metres, times in seconds.
struct SensorUnit {
  std::uint64_t seed = 1;
  FaultSet faults;
  DepthSensor depth_sensor = DepthSensor::kStructuredLight;
  ClassErrors class_errors;
  bool one_camera = false;  ///< Colour and depth come from one camera at one position.

  Intrinsics color_true;
  LensRest color_lens_rest;
  Intrinsics color_written;  ///< As stated in camera.yaml.
  Intrinsics depth_true;
  Intrinsics depth_assumed;  ///< As used for the registration to colour.
  Pose T_color_depth_true = Pose::Identity();
  Pose T_color_depth_assumed = Pose::Identity();
  double depth_units_per_metre = 5000.0;  ///< Unit of the 16-bit file.

  // Systematic depth errors: z (1 + scale) + offset + bow z^2 (r^2 - 1/2) + tilt z^2 (x, y), r = 1
  // at the corner of the image.
  double depth_scale_error = 0.0;
  double depth_offset_m = 0.0;
  double depth_bow_per_m = 0.0;
  std::array<double, 2> depth_tilt_per_m{};
  DepthBend depth_bend;

  // Warm-up: the scale error is warm_up exp(-t / 10 min), with t since the unit was switched on.
  double warm_up = 0.0;
  double on_before_s = 0.0;  ///< Time that it was on before the suite's first sweep.

  // Random depth errors. Factors multiply Nguyen's (2012) axial and lateral models; 0 switches an
  // effect off.
  double axial_noise = 0.0;
  double lateral_noise = 0.0;
  /// Lag at which the correlation of the axial noise has fallen by 90 %.
  double correlation_px = 9.0;
  /// Factor of the axial model in addition to the noise: errors that depend on the projected
  /// pattern at the position of a window. They move with the pattern, so averaging a static view
  /// does not remove them.
  double speckle = 0.0;
  bool quantised = false;  ///< Disparity steps of the PS1080.
  double projector_baseline_m =
      0.0;  ///< Distance of the projector to the right of the infrared camera; 0: no shadow.
  /// Fraction of single pixels lost anywhere; also enables grazing losses and flying pixels.
  double dropout = 0.0;
  double min_range_m = 0.0;
  double max_range_m = 5.0;

  // Times. A frame's colour image is taken at its nominal time and depth `depth_delay_s` later;
  // stamps have additional errors.
  double exposure_s = 0.0;
  double readout_s = 0.0;  ///< Rolling shutter of the colour camera, first to last row.
  /// Rolling shutter of the infrared camera; the depth image's time is that of its middle row.
  double depth_readout_s = 0.0;
  double depth_delay_s = 0.0;
  double color_stamp_bias_s = 0.0;
  double stamp_jitter_s = 0.0;

  // Colour.
  /// Standard deviation of the lens's point spread function, without the pixel's own area.
  double lens_blur_px = 0.0;
  double vignetting = 0.0;  ///< Fraction of light lost at the corner of the image.
  double shot_noise = 0.0;  ///< Variance per unit of linear signal.
  double read_noise = 0.0;  ///< Standard deviation of the linear signal in the dark.
  int jpeg_quality = 0;     ///< 0: lossless PNG.
  ToneCurve tone;

  // Driver. Probabilities per pair of images.
  double lost_frames = 0.0;
  double doubled_frames = 0.0;
  bool steps_exposure = false;       ///< Automatic exposure,
  bool steps_white_balance = false;  ///< and white balance.
};

/// Turns a unit drawn as structured light into one of its class with the same seed: other optics,
/// errors and times (other_classes.cpp).
void BecomeClass(SensorUnit& unit, DepthSensor sensor, double size);

/// The unit of a given seed for images of the given size (multiples of the 640 x 480 optics). Every
/// fault has its own random numbers: switching one off changes nothing else. Without faults it is
/// one ideal pinhole camera that gives colour and depth at the same instant.
[[nodiscard]] SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width, int height,
                                        const FaultSet& faults,
                                        DepthSensor sensor = DepthSensor::kStructuredLight);
/// With MildFaults().
[[nodiscard]] SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width,
                                        int height);

/// Standard deviation of one depth reading (Nguyen 2012), metres. z in metres.
/// @param slant  NguyenSlant() of the incidence: theta^2 / (pi/2 - theta)^2, theta in radians from
///         the surface's normal.
[[nodiscard]] inline double NguyenAxialSigma(double z, double slant) {
  return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4) + 0.0001 / std::sqrt(z) * slant;
}
[[nodiscard]] double NguyenSlant(double incidence);
/// Standard deviation of its position in the image, pixels of a 640 x 480 image.
[[nodiscard]] double NguyenLateralSigma(double incidence);

}  // namespace plumb::simulated

template <>
inline constexpr auto plumb::kNamesOf<plumb::simulated::ToneCurve::Kind> =
    plumb::NamesUpTo<plumb::simulated::ToneCurve::Kind::kSShaped>({"linear", "power", "sRGB",
                                                                   "S-shaped"});
