// SPDX-License-Identifier: Apache-2.0
// What Plumb gives away as DICOM.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/names.hpp"

namespace plumb {

/// kReport: Encapsulated PDF. kPicture: Secondary Capture. kSurface: Encapsulated STL.
/// kRegistration: Spatial Registration. kPatient: a patient's export for another unit, in Raw Data.
enum class DicomExportKind : std::uint8_t {
  kReport,
  kPicture,
  kSurface,
  kRegistration,
  kPatient,
};
template <>
inline constexpr auto kNamesOf<DicomExportKind> = NamesUpTo<DicomExportKind::kPatient>(
    {"report", "picture", "surface", "registration", "patient"});

/// One object. Texts are UTF-8.
struct DicomExport {
  DicomExportKind kind = DicomExportKind::kReport;
  std::string patient_id, patient_name;
  std::string study_uid, series_uid, instance_uid;
  std::int64_t series_number = 1, instance_number = 1;
  std::string date, time;  ///< YYYYMMDD and HHMMSS, local.
  std::string title, version;
  /// Surface: the frame of its coordinates. Registration: the frame that the matrix maps to.
  std::string frame_uid;
  std::string moving_frame_uid;  ///< Registration: the frame that the matrix maps from.
  /// Registration: rigid, millimetres.
  Eigen::Matrix4d T_frame_moving_mm = Eigen::Matrix4d::Identity();
  int width = 0, height = 0;  ///< Picture: its size.
  /// The PDF; the pixels of the picture, 8 bits each of red, green and blue; the binary STL in
  /// millimetres; the archive of the patient's export.
  std::vector<std::uint8_t> payload;
};

/// More than that is refused.
inline constexpr std::size_t kMostExportBytes = std::size_t{128} << 20;

}  // namespace plumb
