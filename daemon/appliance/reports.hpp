// What the reports say, from what is stored. Called on a thread for reads.
#pragma once

#include <string>

#include "daemon/records/store.hpp"

namespace plumb {

/// One page: identity, plan and approval, verdict, the six numbers with uncertainty and tolerance,
/// quality, pictures, acceptance. @throws IoError
[[nodiscard]] std::string ScanReportPdf(Store& store, const web::Scan& scan);
/// All compared scans of a patient, oldest first. @throws IoError
[[nodiscard]] std::string CourseReportPdf(Store& store, const web::Patient& patient);

}  // namespace plumb
