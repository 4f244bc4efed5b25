// SPDX-License-Identifier: Apache-2.0
// A short simulated sweep over a ball between four boards, rendered in memory; its truth beside it.
#pragma once

#include <memory>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/types/frame.hpp"

namespace plumb {

inline constexpr double kSweptBallRadius = 0.10;
inline constexpr int kReferenceBoard = 3;

struct BallSweep {
  StreamInfo info;
  std::vector<Frame> frames;
  std::vector<Pose> T_world_color;  ///< True pose of the colour camera at each colour stamp.
  Pose T_world_reference = Pose::Identity();
  Eigen::Vector3d ball_centre = Eigen::Vector3d::Zero();  ///< World.
};

/// Ideal sensor, 15 frames a second, images of 4:3.
[[nodiscard]] BallSweep MakeBallSweep(int num_frames, int width = 320);

/// A frame in which nothing is to be seen, at the stamps of another.
[[nodiscard]] Frame Blank(const Frame& frame);

}  // namespace plumb
