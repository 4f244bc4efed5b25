// The API under /api/v1: JSON in, JSON and files out. web/openapi.yaml describes it.
#pragma once

#include "web/api/routes.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

/// Adds the routes of the appliance: status, patients, references, scans, audit, settings, updates,
/// maintenance. The services must outlive the routes.
void AddApiRoutes(Routes& routes, const Services& services);

/// Adds GET /result: the last result as a page without script.
void AddResultPage(Routes& routes, const Services& services);

/// Adds the reports as PDF files, and the numbers of a patient as CSV and JSON.
void AddExportRoutes(Routes& routes, const Services& services);

/// Adds the room's calibration and its board as a PDF. Signing needs a password: see Accounts.
void AddRoomCalibrationRoutes(Routes& routes, const Services& services);

}  // namespace plumb::web
