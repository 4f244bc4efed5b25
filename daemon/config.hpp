// The configuration file (TOML): options of reconstruct and compare, checked, with line numbers in every complaint.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "algo/comparison/comparison.hpp"
#include "algo/reconstruction/reconstructor.hpp"

namespace plumb {

/// Markers of the room, for recordings that bring no camera.yaml.
struct MarkerConfig {
  std::optional<std::string> dictionary;  ///< OpenCV's name, or DICT_ARUCO_MIP_36h12.
  std::optional<double> length_m;
  std::optional<int> reference;  ///< Id whose frame is the scene's frame.
};

/// What a configuration file holds; what it leaves out keeps the defaults here.
struct Config {
  MarkerConfig markers;
  ReconstructorOptions reconstruct;
  CompareOptions compare;
  std::optional<std::filesystem::path> region_file;  ///< Absolute, or relative to the configuration file's folder.
};

/// Reads and checks a file.
///
///     [markers]      dictionary, length_m, reference
///     [reconstruct]  preset, keep_color, use_markers, use_keypoints, num_icp_iterations, seed
///     [compare]      preset, region, isocentre_m = [x, y, z], marker_kind = "room"|"couch", posture = "HFS"|"HFP"|"FFS"|"FFP",
///                    shift_tolerance_mm, rotation_tolerance_deg, min_shared_markers, moved_marker_mm, moved_marker_sigmas,
///                    min_coverage, max_hole_mm, max_residual_p95_mm, max_lost_s
///     [iec]          T_iec_reference = 4 rows of 4: reference marker's frame to the IEC fixed frame
///
/// @throws DataError naming file, line, key, what was expected and found. A key that is not listed is an error.
[[nodiscard]] Config ReadConfig(const std::filesystem::path& file);

/// As ReadConfig(), of a text; `name` stands for the file in messages.
[[nodiscard]] Config ParseConfig(const std::string& text, const std::string& name);

/// Vertices of a region file: {"format": 1, "frame": "reference_marker", "polygon_m": [[x, y], ...]}; metres.
/// @throws DataError naming the file and what is wrong with it.
[[nodiscard]] std::vector<Eigen::Vector2d> ReadRegion(const std::filesystem::path& file);

}  // namespace plumb
