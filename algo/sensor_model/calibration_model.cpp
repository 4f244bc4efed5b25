#include "algo/sensor_model/calibration_model.hpp"

namespace plumb {

Eigen::Vector2d CentredCoordinates(double x_px, double y_px, int width, int height) {
  const double half = width / 2.0;
  return {(x_px - (width - 1) / 2.0) / half, (y_px - (height - 1) / 2.0) / half};
}

Intrinsics CalibrationModel::Corrected(const Intrinsics& stated) const {
  Intrinsics corrected = stated;
  const double scale = stated.width / 640.0;
  corrected.fx *= 1.0 + lens[0];
  corrected.fy *= 1.0 + lens[1];
  corrected.cx += lens[2] * scale;
  corrected.cy += lens[3] * scale;
  corrected.distortion[0] += lens[4];
  corrected.distortion[1] += lens[5];
  return corrected;
}

std::map<std::string, double> CalibrationModel::Named() const {
  return {{"focal_x_scale", 1.0 + lens[0]},  {"focal_y_scale", 1.0 + lens[1]},
          {"centre_x_px", lens[2]},          {"centre_y_px", lens[3]},
          {"distortion_k1", lens[4]},        {"distortion_k2", lens[5]},
          {"color_readout_s", readout_s[0]}, {"marker_edge_bias_px", edge_bias_px[0]},
          {"depth_scale", 1.0 + depth[0]},   {"depth_offset_m", depth[1]},
          {"depth_bow_m", depth[2]},         {"depth_shift_x_px", depth[3]},
          {"depth_shift_y_px", depth[4]},    {"depth_delay_s", depth[5]},
          {"depth_slope_x", depth[6]},       {"depth_slope_y", depth[7]},
          {"depth_readout_s", depth[8]}};
}

}  // namespace plumb
