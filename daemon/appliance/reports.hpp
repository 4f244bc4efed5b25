// What the reports say, from what is stored. Called on a thread for reads.
#pragma once

#include <string>

#include "daemon/files/pdf_report.hpp"
#include "daemon/records/store.hpp"
#include "web/service/scan_service.hpp"

namespace plumb {

/// One page: identity, plan and approval, verdict, the six numbers with uncertainty and tolerance,
/// quality, pictures, acceptance.
[[nodiscard]] ScanReport DescribeScan(Store& store, const web::Scan& scan, web::Language language);
/// All compared scans of a patient, oldest first.
[[nodiscard]] CourseReport DescribeCourse(Store& store, const web::Patient& patient,
                                          web::Language language);

/// The same as files. @throws IoError
[[nodiscard]] std::string ScanReportPdf(Store& store, const web::Scan& scan,
                                        web::Language language);
[[nodiscard]] std::string CourseReportPdf(Store& store, const web::Patient& patient,
                                          web::Language language);

}  // namespace plumb
