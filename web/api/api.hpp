// The API under /api/v1: JSON in, JSON and files out. web/openapi.yaml describes it.
#pragma once

#include "web/http/event_hub.hpp"
#include "web/http/router.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

/// Adds the routes of the appliance: status, patients, references, scans, audit, settings, updates,
/// maintenance. The services must outlive the router.
void AddApiRoutes(Router& router, const Services& services);

/// Adds GET /result: the last result as a page without script.
void AddResultPage(Router& router, const Services& services);

/// Adds the reports as PDF files, and the numbers of a patient as CSV and JSON.
void AddExportRoutes(Router& router, const Services& services);

/// Adds the room's calibration and its board as a PDF. Signing needs a password: see Accounts.
void AddRoomCalibrationRoutes(Router& router, const Services& services);

}  // namespace plumb::web
