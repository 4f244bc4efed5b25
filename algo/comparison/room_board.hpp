// SPDX-License-Identifier: Apache-2.0
// Calibrates the axes of the room with a printed board of markers aligned with the room's lasers.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// Limits for a room calibration that may be signed. These are starting values. A value may equal
/// its limit.
struct RoomCalibrationLimits {
  std::size_t min_markers = 3;         ///< Markers of the board seen in each scan.
  double max_rms_m = 2 * kMillimetre;  ///< RMS over the board's corners after the rigid fit.
  /// Distances on the board relative to those of the print, minus 1.
  double max_scale_error = 0.01;
  std::size_t num_scans = 3;             ///< Number of scans whose positions are compared.
  double max_shift_m = 1 * kMillimetre;  ///< Largest distance of the cross between any two scans.
  double max_turn_rad = 0.2 * kDegree;   ///< Largest rotation of the board between any two scans.
};

/// The board: four markers of the room's dictionary and size around a cross, on one sheet. Its
/// frame has its origin at the cross, x to the right and y up on the print, in the direction of the
/// arrow, and z out of the print. When the board lies face up with the cross at the lasers and the
/// arrow to the gantry, its frame is the IEC fixed frame.
struct RoomBoard {
  bool is_a3 = false;                        ///< True: A3; false: A4. Always upright.
  std::map<int, Eigen::Vector2d> centres_m;  ///< Centres of the markers by id.
  double marker_length_m = 0.0;
};

/// The last four ids of a dictionary are reserved for the board; no marker of the room may use
/// them.
[[nodiscard]] std::array<int, 4> RoomBoardIds(int dictionary_size);

/// Chooses A4 if the board fits on it, otherwise A3.
/// @throws std::invalid_argument if markers of that length fit on neither, or the dictionary has
///         fewer than 4 markers.
[[nodiscard]] RoomBoard MakeRoomBoard(int dictionary_size, double marker_length_m);

/// Splits the markers of a sweep into the board's markers (first) and the room's. A single marker
/// with one of the board's ids counts as a marker of the room.
[[nodiscard]] std::pair<MarkerMap, MarkerMap> SplitRoomBoard(const MarkerMap& seen,
                                                             int dictionary_size);

/// Position of the board. Uncertainties are 95 % half-widths of the fit alone; each marker counts
/// as one observation, because the errors of its corners are correlated.
struct BoardFit {
  Pose T_scene_board = Pose::Identity();
  double rms_m = 0.0;
  double scale = 1.0;  ///< Measured distances over those of the print.
  std::size_t num_markers = 0;
  double shift_uncertainty_m = 0.0;   ///< Half-width for the cross in each direction.
  double turn_uncertainty_rad = 0.0;  ///< Half-width about the least certain axis.
};

/// The fit, or one sentence that states why there is none: too few markers, a sheet printed at
/// another scale, or a sheet that is bent or is not this board.
/// @param seen  Markers that do not belong to the board are ignored.
[[nodiscard]] std::variant<BoardFit, Message> FitRoomBoard(
    const RoomBoard& board, const MarkerMap& seen, const RoomCalibrationLimits& limits = {});

/// Markers of one calibration scan, in the scan's own frame.
struct RoomScan {
  MarkerMap room;  ///< Markers of the room, without those of the board.
  BoardFit board;
};

/// The room's markers in IEC axes, computed from several scans of the board.
struct RoomFit {
  MarkerMap markers_iec;                    ///< Markers as the first scan saw them.
  Pose T_iec_reference = Pose::Identity();  ///< From the first scan's frame to IEC axes.
  double shift_m = 0.0;                     ///< Largest distance of the cross between two scans.
  double turn_rad = 0.0;                    ///< Largest rotation of the board between two scans.
  /// Largest of the scans' BoardFit::shift_uncertainty_m and turn_uncertainty_rad.
  double board_shift_m = 0.0, board_turn_rad = 0.0;

  /// Half-widths of 95 % as far as the scans show them: what they differ by, and how well each
  /// places the board. What all scans share, as lasers that miss the isocentre, is in neither.
  [[nodiscard]] double U95_m() const;
  [[nodiscard]] double U95_rad() const;
};

/// Aligns the scans by the room's markers, which do not move, and averages the positions of the
/// board, so that the noise of the reference marker alone does not rotate the room.
/// @return one sentence that states why not: the room's markers of two scans do not agree.
/// @throws std::invalid_argument without a scan.
[[nodiscard]] std::variant<RoomFit, Message> FitRoom(std::span<const RoomScan> scans);

/// Why the calibration may not be signed: too few scans, or scans that differ by more than the
/// limits. Empty if it may.
[[nodiscard]] Message WhyNotSign(const RoomFit& fit, std::size_t num_scans,
                                 const RoomCalibrationLimits& limits = {});

/// Orientation of the room in a scene, from the markers of a calibration. Nothing if fewer than
/// three of them agree with those of the scene.
[[nodiscard]] std::optional<Pose> RoomOf(const MarkerMap& markers_iec, const MarkerMap& scene);

}  // namespace plumb
