// SPDX-License-Identifier: Apache-2.0
// Scans, their files and their reports.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/scan.hpp"

namespace plumb::web {

/// Pictures that are made of a comparison.
enum class ComparisonPicture { kErrorMap, kOverlay };

/// One of the values that a scan's quality is judged by.
struct QualityRow {
  Message name, value;
  bool is_caution = false;  ///< The value is worse than it should be.
};

struct ScanQuality {
  std::vector<QualityRow> rows;
  std::vector<Message> cautions;  ///< To be read beside the verdict: how the scan was taken.
  std::vector<Message> remarks;   ///< What the comparison could not rely on, and warnings.
  /// Why nobody can accept the result, with a reason or without; empty: it can be.
  Message why_not_accept;
};

/// The rules of services.hpp hold.
class ScanService {
 public:
  virtual ~ScanService() = default;

  /// Newest first; all patients: "" (background).
  [[nodiscard]] virtual std::vector<Scan> Scans(const std::string& patient_id, int limit) = 0;
  [[nodiscard]] virtual std::optional<Scan> FindScan(const std::string& id) = 0;
  /// kConflict for a scan without an answer, an old one (2 minutes), one with a newer scan of the
  /// same patient, and while a scan runs.
  /// @param reason  Empty: only a result in tolerance can be accepted. Otherwise the reason for
  ///         accepting one outside tolerance.
  virtual void AcceptScan(const Actor& actor, const std::string& id, const std::string& reason,
                          Done done) = 0;
  /// Removes the scan with its files, for a reason that is logged. kConflict if a reference is made
  /// from it, if it is running, and while a backup is made.
  virtual void RemoveScan(const Actor& actor, const std::string& id, const std::string& reason,
                          Done done) = 0;
  /// A map of a scan in a compact encoding (daemon/files/compact_map.hpp); nothing if there is none
  /// (background).
  /// @param name  "heightmap", "deviation", "deviation_after", "region", "body", or "mesh" for the
  ///         surface.
  [[nodiscard]] virtual std::optional<std::string> CompactMap(const std::string& scan_id,
                                                              const std::string& name) = 0;
  /// Empty if there is no such scan (background).
  [[nodiscard]] virtual ScanQuality QualityOf(const std::string& scan_id) = 0;
  /// A picture of a comparison as a PNG file, with texts and marks in a language; nothing if there
  /// is no such comparison, or it cannot be drawn (background).
  [[nodiscard]] virtual std::optional<std::string> PictureOf(const std::string& scan_id,
                                                             ComparisonPicture picture,
                                                             const Catalogue& language) = 0;
  /// One page about a scan, or the course of a patient, as a PDF file; nothing if there is no such
  /// scan or patient, or the report cannot be drawn (background).
  [[nodiscard]] virtual std::optional<std::string> ScanReport(const std::string& scan_id,
                                                              const Catalogue& language) = 0;
  [[nodiscard]] virtual std::optional<std::string> CourseReport(const std::string& patient_id,
                                                                const Catalogue& language) = 0;
};

}  // namespace plumb::web
