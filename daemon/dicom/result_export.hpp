// SPDX-License-Identifier: Apache-2.0
// A result as DICOM files: report, pictures, the scanned surface and where it lay.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/result/stored_result.hpp"
#include "drivers/dicom/export_content.hpp"

namespace plumb {

struct ResultExportRequest {
  std::filesystem::path result, reference, current;  ///< Folders.
  std::optional<std::filesystem::path> report;       ///< A PDF in place of the result's own page.
  /// Empty: a code that is the same for everything that is compared with this reference.
  std::string patient_id, patient_name;
  std::string paper = "A4";  ///< Of the result's own page; or Letter.
};

struct NamedExport {
  std::string file_name;
  DicomExport object;
};

struct ResultExport {
  std::vector<NamedExport> objects;  ///< The report first.
  std::vector<Message> left_out;     ///< What is not among them, and why.
};

/// The folder that WriteResultExport() writes.
[[nodiscard]] OutputKind DicomExportOutput();

/// The surface's place in the room, without any correction of it: from the frame of the scanned
/// surface to the one of the reference scene or, where the reference is a planning CT, to the axes
/// of the CT (LPS). Rigid, millimetres.
[[nodiscard]] Eigen::Matrix4d ReferenceFromSurface_mm(const StoredResult& result);

/// @throws DataError if the folders do not belong together or cannot be read; IoError
[[nodiscard]] ResultExport DescribeResultExport(const ResultExportRequest& request,
                                                const Catalogue& language);

/// Completely or not at all. @throws DataError, IoError as WriteDicomExport()
void WriteResultExport(const ResultExport& exported, const std::filesystem::path& folder);

}  // namespace plumb
