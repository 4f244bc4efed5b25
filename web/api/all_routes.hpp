// SPDX-License-Identifier: Apache-2.0
// All routes. The API under /api/v1: JSON in, JSON and files out. web/openapi.yaml describes it. A
// route stands in the file of its subject beside this one, and asks an interface of web/service.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>

#include "web/exchange/routes.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

// The services must outlive the routes.

/// Adds patients, sessions, references and templates of plans.
void AddPatientApi(Routes& routes, const Services& services);
/// Adds the upload of a planning CT, what was received from planning systems, and today's worklist.
void AddPlanningApi(Routes& routes, const Services& services);
/// Adds scans, their files, results and daily checks.
void AddScanApi(Routes& routes, const Services& services);
/// Adds GET /metrics for who knows the token. @param token  Empty: the route does not exist.
/// @param certificate_left  Time until the page's certificate ends; nothing without one.
void AddMetricsRoute(Routes& routes, ApplianceService& appliance, const std::string& token,
                     std::function<std::optional<std::chrono::seconds>()> certificate_left);
/// Adds GET /peers/open for units that know the secret. @param secret  Empty: the route does not
/// exist.
void AddPeerRoute(Routes& routes, ApplianceService& appliance, const std::string& secret);
/// Adds status and button, settings, audit log, updates and maintenance.
void AddUnitApi(Routes& routes, const Services& services);

/// Adds live monitoring and the records of its sessions.
void AddMonitorApi(Routes& routes, const Services& services);

/// Adds GET /result: the last result as a page without script.
void AddResultPage(Routes& routes, const Services& services);

/// Adds the reports as PDF files, and the numbers of a patient as CSV and JSON.
void AddExportRoutes(Routes& routes, const Services& services);

/// Adds the profile of the sensor and the judgement of repeated sweeps.
void AddSensorRoutes(Routes& routes, const Services& services);

/// Adds the statistics of set-up, of a patient and of all sites, the latter as CSV, too.
void AddStatisticsRoutes(Routes& routes, const Services& services);

/// Adds the room's calibration and its board as a PDF. Signing needs a password: see Accounts.
void AddRoomCalibrationRoutes(Routes& routes, const Services& services);

}  // namespace plumb::web
