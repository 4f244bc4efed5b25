// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/tracking/ball_sweep.hpp"

#include "drivers/simulator/sensor/simulated_source.hpp"

namespace plumb {

BallSweep MakeBallSweep(int num_frames, int width) {
  using namespace simulated;
  BallSweep sweep;
  Room room;
  for (int i = 0; i < 4; ++i) {
    Board board;
    board.id = kReferenceBoard + i;
    board.T_world_marker.translation() =
        Eigen::Vector3d(i % 2 == 0 ? -0.17 : 0.18, i < 2 ? -0.15 : 0.16, 0.005);
    board.T_world_marker.linear() =
        Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    room.boards.push_back(board);
  }
  room.support_texture = std::make_shared<const Texture>(PaintFloor(4));
  room.skin_texture = std::make_shared<const Texture>(PaintSkin(4));
  sweep.T_world_reference = room.boards.front().T_world_marker;
  sweep.ball_centre = Eigen::Vector3d(0, 0, 0.06);
  const Eigen::AlignedBox3d box(Eigen::Vector3d::Constant(-kSweptBallRadius - 0.03),
                                Eigen::Vector3d::Constant(kSweptBallRadius + 0.03));
  const auto ball = std::make_shared<const DistanceGrid>(
      [](const Eigen::Vector3d& p) { return p.norm() - kSweptBallRadius; }, box, 0.005);
  Pose T_world_ball = Pose::Identity();
  T_world_ball.translation() = sweep.ball_centre;

  SimulatedSweep motion;
  motion.motion = {.half_way_m = 0.13,
                   .height_m = 0.75,
                   .swing_m = 0.08,
                   .swing_period_s = 2.0,
                   .duration_s = num_frames / 15.0};
  motion.num_frames = num_frames;
  motion.rate_hz = 15.0;
  motion.reference_marker = kReferenceBoard;
  SimulatedSource source(std::make_shared<const World>(room, ball, T_world_ball),
                         MakeSensorUnit(NoiseLevel::kIdeal, 1, width, width * 3 / 4), motion);
  sweep.info = source.info();
  while (const auto frame = source.Next()) {
    sweep.frames.push_back(*frame);
    sweep.T_world_color.push_back(source.truth().T_world_camera_at_color);
  }
  return sweep;
}

Frame Blank(const Frame& frame) {
  Frame blank = frame;
  // New images: assigning cv::Mat::zeros() would write into the shared ones.
  blank.color_rgb = cv::Mat(frame.color_rgb.size(), frame.color_rgb.type(), cv::Scalar::all(0));
  blank.depth_m = cv::Mat(frame.depth_m.size(), frame.depth_m.type(), cv::Scalar::all(0));
  return blank;
}

}  // namespace plumb
