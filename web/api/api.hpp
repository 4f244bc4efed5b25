// The API under /api/v1: JSON in, JSON and files out. web/openapi.yaml describes it.
#pragma once

#include "web/http/event_hub.hpp"
#include "web/http/router.hpp"
#include "web/service/scan_service.hpp"

namespace plumb::web {

/// Adds the routes of the appliance's own things: status, patients, references, scans, audit,
/// settings, care. Both must outlive the router.
void AddApiRoutes(Router& router, ScanService& service);

/// Adds GET /result: the last result as a page that needs no script.
void AddResultPage(Router& router, ScanService& service);

/// Adds the reports as PDF files, and the numbers of a patient as CSV and JSON.
void AddExportRoutes(Router& router, ScanService& service);

}  // namespace plumb::web
