// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_model/depth_sensor.hpp"

#include <array>

namespace plumb {
namespace {

// Of a RealSense D435 at 640 columns: focal length 390 px, baseline 50.2 mm (from a maker's
// recording). Its depth may be off by 0.3 px after a shock or with heat, and by 0.2 px more from
// one side of the image to the other.
constexpr double kPxMetres = 390.43 * 0.0502;
constexpr double kDisparity = 0.3 / kPxMetres;
constexpr double kDisparityTilt = 0.1 / kPxMetres;

constexpr std::array<DepthSensorClass, 4> kClasses = {{
    // Structured light: what every default of the method was chosen for.
    {},
    // Measured on two RealSense cameras at rest, 0.38 to 3.4 m: sigma 2.0 to 3.0 mm/m2 z2, the same
    // in every direction; neighbours' correlation 0.05 to 0.16 at 16 px. The matching window makes
    // edges 4 to 8 px fat. Both imagers have a global shutter.
    {.noise = {.constant_m = 0.0001,
               .linear_m_per_m = 0.0,
               .quadratic_m_per_m2 = 0.0025,
               .origin_m = 0.0,
               .grazing_m = 0.0001},
     .range = {.nearest_m = 0.2, .farthest_m = 3.0},
     .correlation_px = 10.0,
     .edge_px = 4,
     .sigmas = {.disparity_per_m = kDisparity,
                .disparity_tilt_per_m = kDisparityTilt,
                .scale = 0.01,
                .offset_m = 0.0,
                .bow_m = 0.004,
                .slope = 0.003,
                .field = 1.0,
                .growth = 1.0,
                .readout_s = 0.0}},
    // Azure Kinect and its successors: 1 to 2 mm at 1 m, grows with the square of the distance;
    // offset by surface, temperature and multipath 10 mm.
    {.noise = {.constant_m = 0.001,
               .linear_m_per_m = 0.0,
               .quadratic_m_per_m2 = 0.001,
               .origin_m = 0.0,
               .grazing_m = 0.0001},
     .range = {.nearest_m = 0.25, .farthest_m = 3.8},
     .correlation_px = 2.0,
     .edge_px = 2,
     .sigmas = {.disparity_per_m = 0.0,
                .disparity_tilt_per_m = 0.0,
                .scale = 0.003,
                .offset_m = 0.010,
                .bow_m = 0.004,
                .slope = 0.003,
                .field = 0.3,
                .growth = 0.3,
                .readout_s = 0.0}},
    // A phone's: a sparse range finder of 192 to 256 columns, interpolated along the colour image's
    // edges. Plane fits of a flat door: 7 mm RMS, not white in space or time.
    // Its spots lie some 25 px apart; errors between them reach over two. What lies on colour's
    // edges is beside colour neither in place nor in time; a sweep does not see it: with the usual
    // 2 px and 4 ms the shifts found scatter by 1.4 px, and the bodies by 1.5 mm (unit 82).
    // It measures times, so that its scale is that of a clock. With 0.01, scale and offset exchange
    // 0.01 for 11 mm between the sweeps of unit 88, whose heights scatter by 0.96 mm; with 0.003,
    // by 0.45 mm.
    {.noise = {.constant_m = 0.005,
               .linear_m_per_m = 0.0,
               .quadratic_m_per_m2 = 0.0,
               .origin_m = 0.0,
               .grazing_m = 0.0},
     .range = {.nearest_m = 0.35, .farthest_m = 4.0},
     .correlation_px = 50.0,
     .edge_px = 3,
     .sigmas = {.disparity_per_m = 0.0,
                .disparity_tilt_per_m = 0.0,
                .scale = 0.003,
                .offset_m = 0.010,
                .bow_m = 0.0,
                .shift_px = 0.3,
                .delay_s = 0.001,
                .slope = 0.0,
                .field = 0.0,
                .growth = 0.0,
                .readout_s = 0.0}},
}};

}  // namespace

const DepthSensorClass& ClassOf(DepthSensor sensor) {
  return kClasses.at(static_cast<std::size_t>(sensor));
}

}  // namespace plumb
