// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/room_board.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "algo/base/statistics.hpp"
#include "algo/comparison/scene_alignment.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "words/check.hpp"

namespace plumb {
namespace {

constexpr std::size_t kLeastOfBoard = 2;
constexpr double kMinSigma_m = 1e-5;  // lower limit for synthetic markers that fit exactly

// Printable area for markers: the sheet without its margin of 6 mm and the ruler's 22 mm.
const Eigen::Vector2d kRoomA4_m(0.198, 0.263);
const Eigen::Vector2d kRoomA3_m(0.285, 0.386);
// A marker needs a white border of one cell. The coarsest dictionary has 4 + 2 cells per side.
constexpr double kWhiteRatio = 4.0 / 3.0;
constexpr double kGap_m = 4 * kMillimetre;  // space for the cross

MarkerCorners CornersOnBoard(const Eigen::Vector2d& centre_m, double length_m) {
  MarkerCorners corners = CornersInMarkerFrame(length_m);
  for (Eigen::Vector3d& corner : corners) corner.head<2>() += centre_m;
  return corners;
}

Eigen::Vector3d MeanOf(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) sum += p;
  return sum / static_cast<double>(points.size());
}

double SpreadOf(std::span<const Eigen::Vector3d> points) {
  const Eigen::Vector3d mean = MeanOf(points);
  double sum = 0.0;
  for (const Eigen::Vector3d& p : points) sum += (p - mean).squaredNorm();
  return std::sqrt(sum / static_cast<double>(points.size()));
}

// Half-widths for the position of the cross and for the least certain rotation, from the scatter of
// the markers.
void AddUncertainty(BoardFit& fit, std::span<const Eigen::Vector3d> centres_board, double sigma_m) {
  const auto num = static_cast<double>(centres_board.size());
  // Each marker contributes 3 coordinates, and the fit uses 6 degrees of freedom.
  const double from_fit = fit.rms_m / std::sqrt(3.0) * std::sqrt(3 * num / (3 * num - 6));
  const double sigma = std::max({from_fit, sigma_m, kMinSigma_m});
  const Eigen::Vector3d mean = MeanOf(centres_board);
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : centres_board) {
    const Eigen::Vector3d d = p - mean;
    inertia += d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia);
  const double turn = sigma / std::sqrt(solver.eigenvalues()(0));
  fit.turn_uncertainty_rad = kCover95 * turn;
  fit.shift_uncertainty_m = kCover95 * std::hypot(sigma / std::sqrt(num), turn * mean.norm());
}

}  // namespace

std::array<int, 4> RoomBoardIds(int dictionary_size) {
  const int first = dictionary_size - 4;
  if (first < 0) {
    throw std::invalid_argument(
        fmt::format("the room's board needs 4 markers, this dictionary has {}", dictionary_size));
  }
  return {first, first + 1, first + 2, first + 3};
}

RoomBoard MakeRoomBoard(int dictionary_size, double marker_length_m) {
  const std::array<int, 4> ids = RoomBoardIds(dictionary_size);
  const double cell_m = kWhiteRatio * marker_length_m;
  const auto fits = [&](const Eigen::Vector2d& room) {
    return marker_length_m >= 0.01 && 2 * cell_m + kGap_m <= room.x();
  };
  if (!fits(kRoomA3_m)) {
    throw std::invalid_argument(fmt::format(
        "four markers of {:g} m do not fit on an A3 sheet, expected 0.01 to {:.3f} m",
        marker_length_m, std::floor(1000 * (kRoomA3_m.x() - kGap_m) / 2 / kWhiteRatio) / 1000));
  }
  RoomBoard board{.is_a3 = !fits(kRoomA4_m), .centres_m = {}, .marker_length_m = marker_length_m};
  const Eigen::Vector2d room = board.is_a3 ? kRoomA3_m : kRoomA4_m;
  // Whole millimetres, so that the distances can be checked on the sheet with a ruler.
  const double x = std::floor((room.x() - cell_m) / 2 * 1000) / 1000;
  const double y = std::floor((room.y() - cell_m) / 2 * 1000) / 1000;
  board.centres_m = {{ids[0], {-x, y}}, {ids[1], {x, y}}, {ids[2], {-x, -y}}, {ids[3], {x, -y}}};
  return board;
}

std::pair<MarkerMap, MarkerMap> SplitRoomBoard(const MarkerMap& seen, int dictionary_size) {
  const std::array<int, 4> ids = RoomBoardIds(dictionary_size);
  std::pair<MarkerMap, MarkerMap> parts;
  for (const auto& [id, marker] : seen) {
    const bool is_board = std::find(ids.begin(), ids.end(), id) != ids.end();
    (is_board ? parts.first : parts.second).emplace(id, marker);
  }
  // A single marker with such an id belongs to the room rather than to a sheet of four.
  if (parts.first.size() < kLeastOfBoard) parts.second.merge(std::exchange(parts.first, {}));
  return parts;
}

std::variant<BoardFit, Message> FitRoomBoard(const RoomBoard& board, const MarkerMap& seen,
                                             const RoomCalibrationLimits& limits) {
  std::vector<Eigen::Vector3d> on_board, in_scene, centres_board, centres_scene;
  double variance = 0.0;
  for (const auto& [id, centre_m] : board.centres_m) {
    const auto found = seen.find(id);
    if (found == seen.end()) continue;
    const MarkerCorners known = CornersOnBoard(centre_m, board.marker_length_m);
    const MarkerCorners& corners = found->second.corners;
    on_board.insert(on_board.end(), known.begin(), known.end());
    in_scene.insert(in_scene.end(), corners.begin(), corners.end());
    centres_board.push_back(CentreOf(known));
    centres_scene.push_back(CentreOf(corners));
    variance += found->second.sigma_m * found->second.sigma_m;
  }
  const std::size_t num = centres_board.size();
  if (num < limits.min_markers) {
    return say::check::BoardFew(static_cast<std::int64_t>(num),
                                static_cast<std::int64_t>(board.centres_m.size()),
                                static_cast<std::int64_t>(limits.min_markers));
  }
  BoardFit fit{.scale = SpreadOf(centres_scene) / SpreadOf(centres_board), .num_markers = num};
  if (!(std::abs(fit.scale - 1) <= limits.max_scale_error)) {
    return say::check::BoardScale(100 * fit.scale, 100 * limits.max_scale_error);
  }
  const RigidFit rigid = FitRigid(in_scene, on_board);
  fit.T_scene_board = rigid.T_a_b;
  fit.rms_m = rigid.rms_m;
  if (!rigid.valid || !(fit.rms_m <= limits.max_rms_m)) {
    return say::check::BoardMisfit(fit.rms_m / kMillimetre, limits.max_rms_m / kMillimetre);
  }
  AddUncertainty(fit, centres_board, std::sqrt(variance / static_cast<double>(num)));
  return fit;
}

double RoomFit::U95_m() const { return std::hypot(shift_m, board_shift_m); }

double RoomFit::U95_rad() const { return std::hypot(turn_rad, board_turn_rad); }

std::variant<RoomFit, Message> FitRoom(std::span<const RoomScan> scans) {
  if (scans.empty()) throw std::invalid_argument("FitRoom() needs a scan");
  std::vector<Pose> boards;  // in the first scan's frame
  for (std::size_t i = 0; i < scans.size(); ++i) {
    Pose T_first_scan = Pose::Identity();
    if (i > 0) {
      const AlignmentOutcome outcome = AlignScenes(scans[0].room, scans[i].room);
      if (!outcome.alignment) {
        return say::check::RoomMoved();
      }
      T_first_scan = outcome.alignment->T_reference_current;
    }
    boards.push_back(T_first_scan * scans[i].board.T_scene_board);
  }
  RoomFit fit;
  for (const RoomScan& scan : scans) {
    fit.board_shift_m = std::max(fit.board_shift_m, scan.board.shift_uncertainty_m);
    fit.board_turn_rad = std::max(fit.board_turn_rad, scan.board.turn_uncertainty_rad);
  }
  Eigen::Vector3d cross = Eigen::Vector3d::Zero();
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  for (const Pose& board : boards) {
    cross += board.translation() / static_cast<double>(boards.size());
    turns += board.linear();
    for (const Pose& other : boards) {
      const Pose T = board.inverse() * other;
      fit.shift_m = std::max(fit.shift_m, T.translation().norm());
      fit.turn_rad = std::max(fit.turn_rad, Eigen::AngleAxisd(T.linear()).angle());
    }
  }
  // The rotation nearest to the sum of the rotations (chordal mean).
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turns, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity();
  mirror(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  Pose T_scan_board = Pose::Identity();
  T_scan_board.linear() = svd.matrixU() * mirror * svd.matrixV().transpose();
  T_scan_board.translation() = cross;
  fit.T_iec_reference = T_scan_board.inverse();
  for (const auto& [id, marker] : scans[0].room) {
    SceneMarker placed = marker;
    for (Eigen::Vector3d& corner : placed.corners) corner = fit.T_iec_reference * corner;
    fit.markers_iec.emplace(id, placed);
  }
  return fit;
}

Message WhyNotSign(const RoomFit& fit, std::size_t num_scans, const RoomCalibrationLimits& limits) {
  if (num_scans < limits.num_scans) {
    return say::check::BoardMoreScans(static_cast<std::int64_t>(num_scans),
                                      static_cast<std::int64_t>(limits.num_scans));
  }
  if (fit.shift_m <= limits.max_shift_m && fit.turn_rad <= limits.max_turn_rad) return {};
  return say::check::BoardScansDiffer(fit.shift_m / kMillimetre, fit.turn_rad / kDegree,
                                      limits.max_shift_m / kMillimetre,
                                      limits.max_turn_rad / kDegree);
}

std::optional<Pose> RoomOf(const MarkerMap& markers_iec, const MarkerMap& scene) {
  const AlignmentOutcome outcome = AlignScenes(markers_iec, scene);
  return outcome.alignment ? std::optional(outcome.alignment->T_reference_current) : std::nullopt;
}

}  // namespace plumb
