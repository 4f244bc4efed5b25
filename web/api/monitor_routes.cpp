// SPDX-License-Identifier: Apache-2.0
// Live monitoring and the records of its sessions.
#include "web/api/all_routes.hpp"

#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "algo/base/parse_number.hpp"
#include "web/exchange/csv.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr const char* kCsv = "text/csv; charset=utf-8";

/// "2.json" and "2.csv": the report and the frames of a scan's second session.
Response RecordResponse(MonitoringService& monitoring, const Request& request) {
  const std::string& scan = request.arguments[0];
  const std::string_view name = request.arguments[1];
  const bool is_csv = name.ends_with(".csv");
  if (!is_csv && !name.ends_with(".json")) return ErrorResponse(404, say::web::NothingHere());
  const auto number = ParseNumber<int>(name.substr(0, name.rfind('.')));
  if (!number || *number < 1) return ErrorResponse(404, say::web::NothingHere());
  if (!is_csv) {
    const auto report = monitoring.MonitorReport(scan, *number);
    if (report.is_null()) return ErrorResponse(404, say::web::NothingHere());
    return BodyResponse("application/json", report.dump());
  }
  const std::string csv = monitoring.MonitorCsv(scan, *number);
  if (csv.empty()) return ErrorResponse(404, say::web::NothingHere());
  return Download(kCsv, CsvFor(LanguageIn(request), csv),
                  fmt::format("plumb_monitoring_{}_{}.csv", scan, *number));
}

}  // namespace

void AddMonitorApi(Routes& routes, const Services& services) {
  MonitoringService& monitoring = services.monitoring;
  routes.Read("/api/v1/monitor", Permission::kRoom, [&monitoring](const Request&) {
    return JsonResponse(MonitorJson(monitoring.GetMonitor()));
  });
  routes
      .Read("/api/v1/monitor/map", Permission::kRoom,
            [&monitoring](const Request&) {
              const auto map = monitoring.MonitorMap();
              if (!map) return ErrorResponse(404, say::web::NoSurface());
              return BodyResponse("application/octet-stream", *map);
            })
      .Discloses("view.camera");
  routes.Write("POST", "/api/v1/monitor/start", Permission::kScan, BodyKind::kNone,
               [&monitoring](const Request& request, const Done& done) {
                 monitoring.StartMonitor(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/monitor/stop", Permission::kScan, BodyKind::kNone,
               [&monitoring](const Request& request, const Done& done) {
                 monitoring.StopMonitor(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/monitor/breath/teach", Permission::kScan, BodyKind::kNone,
               [&monitoring](const Request& request, const Done& done) {
                 monitoring.TeachBreath(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/monitor/breath/forget", Permission::kScan, BodyKind::kNone,
               [&monitoring](const Request& request, const Done& done) {
                 monitoring.ForgetBreath(request.actor(), done);
               });
  routes
      .ReadInBackground("/api/v1/monitor/record.csv", Permission::kView,
                        [&monitoring](const Request& request) {
                          const std::string csv = monitoring.MonitorCsv("", 0);
                          if (csv.empty()) return ErrorResponse(404, say::web::NothingHere());
                          return Download(kCsv, CsvFor(LanguageIn(request), csv),
                                          "plumb_monitoring.csv");
                        })
      .Discloses("", "download.monitoring");
  routes
      .ReadInBackground(
          "/api/v1/scans/{id}/monitoring", Permission::kView,
          [&monitoring](const Request& request) {
            return JsonResponse({{"records", monitoring.MonitorRecords(request.arguments[0])}});
          })
      .Discloses("view.scan");
  routes
      .ReadInBackground(
          "/api/v1/scans/{id}/monitoring/{name}", Permission::kView,
          [&monitoring](const Request& request) { return RecordResponse(monitoring, request); })
      .Discloses("view.scan", "download.monitoring");
}

}  // namespace plumb::web
