// Where the room's axes lie, from a printed board of markers that lies at the room's lasers.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/base/units.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// Limits of what may be signed as a room's calibration; starting values. A value may reach its
/// limit.
struct RoomCalibrationLimits {
  std::size_t min_markers = 3;           ///< Of the board, in each scan.
  double max_rms_m = 2 * kMillimetre;    ///< Of the board's corners after the rigid fit.
  double max_scale_share = 0.01;         ///< Distances on the board against those of the print.
  std::size_t num_scans = 3;             ///< Whose positions are held against each other.
  double max_shift_m = 1 * kMillimetre;  ///< Of the cross, between any two scans.
  double max_turn_rad = 0.2 * kDegree;   ///< Likewise.
};

/// The board: four markers of the room's dictionary and size around a cross, one sheet. Its frame
/// is at the cross: x right on the print, y up on the print, where the arrow points, z out of it.
/// Lying face up with the cross at the lasers and the arrow to the gantry, that frame is the IEC
/// fixed frame.
struct RoomBoard {
  bool is_a3 = false;                        ///< Else A4; upright.
  std::map<int, Eigen::Vector2d> centres_m;  ///< Of the markers, by id.
  double marker_length_m = 0.0;
};

/// The last four ids of a dictionary belong to the board; no marker of the room may have one.
[[nodiscard]] std::array<int, 4> RoomBoardIds(int dictionary_size);

/// On A4 if it fits, else on A3.
/// @throws std::invalid_argument where markers of that length fit on neither, or the dictionary has
/// fewer than 4 markers.
[[nodiscard]] RoomBoard MakeRoomBoard(int dictionary_size, double marker_length_m);

/// Splits what a sweep saw into the board's markers (first) and the room's. A single one of the
/// board's is taken for a marker of the room that has its number.
[[nodiscard]] std::pair<MarkerMap, MarkerMap> SplitRoomBoard(const MarkerMap& seen,
                                                             int dictionary_size);

/// Where the board lay. Uncertainties are 95 % half-widths of the fit alone, each marker counted as
/// one observation, because the errors of a marker's corners go together.
struct BoardFit {
  Pose T_scene_board = Pose::Identity();
  double rms_m = 0.0;
  double scale = 1.0;  ///< Distances seen over those of the print.
  std::size_t num_markers = 0;
  double shift_uncertainty_m = 0.0;   ///< Of the cross, in each direction.
  double turn_uncertainty_rad = 0.0;  ///< About the axis that is determined worst.
};

/// The fit, or one sentence why there is none: too few markers, a sheet that was printed at another
/// scale, or one that is bent or not this board.
/// @param seen  Others than the board's are left out.
[[nodiscard]] std::variant<BoardFit, std::string> FitRoomBoard(
    const RoomBoard& board, const MarkerMap& seen, const RoomCalibrationLimits& limits = {});

/// What one calibration scan saw, both in the scan's own frame.
struct RoomScan {
  MarkerMap room;  ///< The room's markers, without the board's.
  BoardFit board;
};

/// The room's markers in IEC axes, from several scans of the board.
struct RoomFit {
  MarkerMap markers_iec;                    ///< Of the first scan.
  Pose T_iec_reference = Pose::Identity();  ///< From the first scan's frame.
  double shift_m = 0.0;                     ///< Largest distance of the cross between two scans.
  double turn_rad = 0.0;                    ///< Largest turn of the board between two scans.
};

/// Brings the scans together by the room's markers, which hold still, and takes the mean position
/// of the board: so the reference marker's own noise does not swing the room about it.
/// @return one sentence why not: the room's markers of two scans do not agree.
/// @throws std::invalid_argument without a scan.
[[nodiscard]] std::variant<RoomFit, std::string> FitRoom(std::span<const RoomScan> scans);

/// Why this may not be signed: too few scans, or they differ by more than the limits allow. Empty:
/// it may.
[[nodiscard]] std::string WhyNotSign(const RoomFit& fit, std::size_t num_scans,
                                     const RoomCalibrationLimits& limits = {});

/// Where the room lies in a scene, from the markers of a calibration. Nothing where fewer than
/// three of them agree with those of the scene.
[[nodiscard]] std::optional<Pose> RoomOf(const MarkerMap& markers_iec, const MarkerMap& scene);

}  // namespace plumb
