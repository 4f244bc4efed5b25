// One simulated sensor: its true optics and errors, and the calibration that its owner believes.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "drivers/simulated/faults.hpp"
#include "drivers/simulated/tone_curve.hpp"

namespace plumb::simulated {

/// What bends the depth image beside the terms of the method's sensor model. The relative error of
/// depth is radial_error(r) + field_rms f(x, y) + change_rms g(x, y) s(z): f and g are two
/// SmoothField()s, s(z) = d / (1 + |d|) with d = (z - 0.9 m) / 0.4 m.
struct DepthBend {
  double radial = 0.0;          ///< At the image's corner.
  double radial_quartic = 0.0;  ///< Share of it that grows with r^4 and not with r^2, 0 to 1.
  double field_rms = 0.0;
  double change_rms = 0.0;
  std::uint64_t field_seed = 0;
  std::uint64_t change_seed = 0;
};

/// What the colour lens does beside OpenCV's five terms, in normalised coordinates, added to what
/// they give: x += s1 r^2 + s2 r^4, y += s3 r^2 + s4 r^4 (thin prism), and the radial factor k4
/// r^8.
struct LensRest {
  std::array<double, 4> prism{};
  double k4 = 0.0;
  bool operator==(const LensRest&) const = default;
};

/// A unit of the Xtion class: projector, infrared camera and colour camera apart from each other.
/// Lengths in metres, times in seconds.
struct SensorUnit {
  std::uint64_t seed = 1;
  FaultSet faults;
  bool one_camera = false;  ///< Colour and depth are of one camera at one place.

  Intrinsics color_true;
  LensRest color_lens_rest;
  Intrinsics color_written;  ///< What camera.yaml says.
  Intrinsics depth_true;
  Intrinsics depth_assumed;  ///< What the registration to colour uses.
  Pose T_color_depth_true = Pose::Identity();
  Pose T_color_depth_assumed = Pose::Identity();
  double depth_units_per_metre = 5000.0;  ///< Of the 16-bit file.

  // Systematic depth errors: z (1 + scale) + offset + bow z^2 (r^2 - 1/2) + tilt z^2 (x, y), r = 1
  // at the image's corner.
  double depth_scale_error = 0.0;
  double depth_offset_m = 0.0;
  double depth_bow_per_m = 0.0;
  std::array<double, 2> depth_tilt_per_m{};
  DepthBend depth_bend;

  // Warming up: the scale errs by warm_up exp(-t / 10 min), t since the unit was switched on.
  double warm_up = 0.0;
  double on_before_s = 0.0;  ///< How long it was on before the suite's first sweep.

  // Random depth errors. Factors multiply Nguyen's (2012) axial and lateral models; 0 switches an
  // effect off.
  double axial_noise = 0.0;
  double lateral_noise = 0.0;
  double correlation_px = 9.0;  ///< Lag at which the axial noise has lost 90 % of its correlation.
  /// Of the axial model, beside the noise: errors that the projected pattern has at the place of a
  /// window. They stay with the pattern, so averaging over a steady view does not remove them.
  double speckle = 0.0;
  bool quantised = false;  ///< The PS1080's disparity steps.
  double projector_baseline_m =
      0.0;               ///< Projector to the right of the infrared camera; 0: no shadow.
  double dropout = 0.0;  ///< Share of single pixels lost anywhere; also switches grazing losses and
                         ///< flying pixels on.
  double min_range_m = 0.0;
  double max_range_m = 5.0;

  // Times. A frame's colour image is taken at its nominal time, depth `depth_delay_s` later; stamps
  // err beside that.
  double exposure_s = 0.0;
  double readout_s = 0.0;        ///< Rolling shutter of the colour camera, first to last row.
  double depth_readout_s = 0.0;  ///< Rolling shutter of the infrared camera; the depth image's time
                                 ///< is that of its middle row.
  double depth_delay_s = 0.0;
  double color_stamp_bias_s = 0.0;
  double stamp_jitter_s = 0.0;

  // Colour.
  double lens_blur_px =
      0.0;  ///< Standard deviation of the lens's point spread, beside the pixel's own area.
  double vignetting = 0.0;  ///< Light lost at the image's corner.
  double shot_noise = 0.0;  ///< Variance per unit of linear signal.
  double read_noise = 0.0;  ///< Standard deviation of the linear signal in the dark.
  int jpeg_quality = 0;     ///< 0: lossless PNG.
  ToneCurve tone;

  // The driver. Chances by pair of images.
  double lost_frames = 0.0;
  double doubled_frames = 0.0;
  bool steps_exposure = false;       ///< Automatic exposure,
  bool steps_white_balance = false;  ///< and white balance.
};

/// The unit of a given seed, for images of the given size (multiples of the 640 x 480 optics).
/// Every fault has its own random numbers: switching one off changes nothing else of the unit.
/// Ideal without faults: one pinhole camera that gives colour and depth at the same instant.
[[nodiscard]] SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width, int height,
                                        const FaultSet& faults);
/// With MildFaults().
[[nodiscard]] SensorUnit MakeSensorUnit(NoiseLevel level, std::uint64_t seed, int width,
                                        int height);

/// Standard deviation of one depth reading (Nguyen 2012), metres. z in metres.
/// @param slant  NguyenSlant() of the incidence: theta^2 / (pi/2 - theta)^2, theta in radians from
/// the surface's normal.
[[nodiscard]] inline double NguyenAxialSigma(double z, double slant) {
  return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4) + 0.0001 / std::sqrt(z) * slant;
}
[[nodiscard]] double NguyenSlant(double incidence);
/// Standard deviation of its place in the image, pixels of a 640 x 480 image.
[[nodiscard]] double NguyenLateralSigma(double incidence);

}  // namespace plumb::simulated
