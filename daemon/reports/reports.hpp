// SPDX-License-Identifier: Apache-2.0
// Assembles the reports from stored records. Called on a thread for reads.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/records/patient_store.hpp"
#include "daemon/records/reference_store.hpp"
#include "daemon/records/scan_store.hpp"
#include "daemon/reports/pdf_report.hpp"
#include "daemon/reports/report_pictures.hpp"
#include "web/model/couch.hpp"
#include "web/service/scan_service.hpp"

namespace plumb {

/// The records that a report uses; borrowed.
struct ReportSources {
  PatientStore& patients;
  ReferenceStore& references;
  ScanStore& scans;
  double warm_up_min;       ///< Time that a sensor must have been on to be warm.
  RoomFinder room_in = {};  ///< As the room is known now: for pictures of plans.
  CouchProfile couch = {};
  std::string paper = "A4";  ///< Or Letter.
};

/// One page: identity, plan and approval, verdict, the six numbers with uncertainty and tolerance,
/// quality, pictures, acceptance.
[[nodiscard]] ScanReport DescribeScan(const ReportSources& stored, const Scan& scan,
                                      const Catalogue& language);
/// All compared scans of a patient, oldest first.
[[nodiscard]] CourseReport DescribeCourse(const ReportSources& stored, const Patient& patient,
                                          const Catalogue& language);

/// The pictures of the comparison as PNG files, in the order of web::ComparisonPicture; empty if
/// the scan was not compared, or a record or file that they need is missing or damaged.
[[nodiscard]] std::vector<std::string> ComparisonPngs(const ReportSources& stored, const Scan& scan,
                                                      const Catalogue& language);

/// The reports as files. @throws IoError
[[nodiscard]] std::string ScanReportPdf(const ReportSources& stored, const Scan& scan,
                                        const Catalogue& language);
[[nodiscard]] std::string CourseReportPdf(const ReportSources& stored, const Patient& patient,
                                          const Catalogue& language);

}  // namespace plumb
