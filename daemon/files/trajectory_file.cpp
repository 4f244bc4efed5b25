// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/trajectory_file.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

#include "algo/base/errors.hpp"
#include "words/scene_file.hpp"

namespace plumb {
namespace {

constexpr double kMaxTranslation_m = 1e4;
constexpr double kQuaternionTolerance = 1e-3;

/// Removes the next number from the line; false if there is none.
bool TakeNumber(std::string_view& line, double& value) {
  const std::size_t begin = line.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return false;
  line.remove_prefix(begin);
  const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), value);
  line.remove_prefix(static_cast<std::size_t>(end - line.data()));
  return error == std::errc{} && (line.empty() || line.front() == ' ' || line.front() == '\t');
}

}  // namespace

std::string TrajectoryText(std::span<const StampedPose> poses) {
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& pose : poses) {
    const Eigen::Vector3d t = pose.T_world_camera.translation();
    Eigen::Quaterniond q(pose.T_world_camera.linear());
    q.normalize();
    if (q.w() < 0) q.coeffs() = -q.coeffs();
    text += fmt::format("{:.6f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", pose.time_s,
                        t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  return text;
}

std::vector<StampedPose> ParseTrajectory(std::string_view text, const std::string& name) {
  std::vector<StampedPose> poses;
  std::int64_t line_number = 0;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++line_number;
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    const std::size_t begin = line.find_first_not_of(" \t");
    if (begin == std::string_view::npos || line[begin] == '#') continue;

    std::array<double, 8> v{};
    bool good = true;
    for (double& value : v) good = good && TakeNumber(line, value) && std::isfinite(value);
    if (!good || line.find_first_not_of(" \t") != std::string_view::npos) {
      throw DataError(say::scene_file::PoseLine(name, line_number));
    }
    const Eigen::Vector3d translation_m(v[1], v[2], v[3]);
    const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    if (std::abs(q.norm() - 1) > kQuaternionTolerance ||
        translation_m.cwiseAbs().maxCoeff() > kMaxTranslation_m) {
      throw DataError(say::scene_file::PoseRange(name, line_number, q.norm(), translation_m.norm(),
                                                 kMaxTranslation_m));
    }
    if (!poses.empty() && !(v[0] > poses.back().time_s)) {
      throw DataError(say::scene_file::PoseOrder(name, line_number, v[0], poses.back().time_s));
    }
    StampedPose pose{v[0], Pose::Identity()};
    pose.T_world_camera.linear() = q.normalized().toRotationMatrix();
    pose.T_world_camera.translation() = translation_m;
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace plumb
