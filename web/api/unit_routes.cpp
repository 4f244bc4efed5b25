// SPDX-License-Identifier: Apache-2.0
// The unit: status and button, settings, audit log, updates, maintenance.
#include "web/api/all_routes.hpp"

#include <cmath>
#include <filesystem>
#include <string>
#include <utility>

#include "algo/base/base64.hpp"
#include "algo/base/errors.hpp"
#include "web/api/look_back.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/http/checks.hpp"
#include "web/model/audit.hpp"
#include "web/model/limits.hpp"
#include "web/model/settings.hpp"
#include "web/model/status.hpp"
#include "web/model/wall_clock.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

Json OutlineJson(const CameraOutline& outline) {
  const auto rounded = [](float share) { return std::round(share * 1e4) / 1e4; };
  Json lines = Json::array();
  for (const auto& line : outline.lines) {
    Json& points = lines.emplace_back(Json::array());
    for (const auto& [x, y] : line) points.push_back({rounded(x), rounded(y)});
  }
  return {{"picture", ToBase64(outline.jpeg)},
          {"reference", outline.reference},
          {"lines", lines},
          {"is_placed", outline.is_placed}};
}

void AddApplianceRoutes(Routes& routes, ApplianceService& appliance) {
  routes.Read("/health", Permission::kNone, [&appliance](const Request&) {
    const Health health = appliance.GetHealth();
    if (health.ok) return JsonResponse({{"status", "ok"}});
    Json failed = {{"status", "failed"}};
    PutMessage(failed, "reason", health.reason);
    return JsonResponse(failed, /*status=*/503);
  });
  routes.Read("/api/v1/status", Permission::kRoom, [&appliance](const Request&) {
    return JsonResponse(ToJson(appliance.GetStatus(), WallClock::now()));
  });
  routes
      .Read("/api/v1/preview", Permission::kRoom,
            [&appliance](const Request&) {
              const auto picture = appliance.Preview();
              if (!picture) return ErrorResponse(404, say::web::NoCameraImage());
              return BodyResponse("image/jpeg", *picture);
            })
      .Discloses("view.camera");
  routes
      .Read("/api/v1/preview/outline", Permission::kRoom,
            [&appliance](const Request&) {
              const auto outline = appliance.Outline();
              if (!outline) return ErrorResponse(404, say::web::NoOutline());
              return JsonResponse(OutlineJson(*outline));
            })
      .Discloses("view.camera");
  routes
      .Read("/api/v1/scan/surface", Permission::kRoom,
            [&appliance](const Request&) {
              const auto map = appliance.SweptSurface();
              if (!map) return ErrorResponse(404, say::web::NoSurface());
              return BodyResponse("application/octet-stream", *map);
            })
      .Discloses("view.camera");
  routes.Write("POST", "/api/v1/press", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.Press(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/scan/start", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.StartSweep(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/scan/end", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.EndSweep(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/cancel", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.Cancel(request.actor(), done);
               });
}

void AddSettingsRoutes(Routes& routes, SettingsService& settings, AuditLog& audit) {
  routes
      .ReadInBackground(
          "/api/v1/audit", Permission::kAudit,
          [&audit](const Request& request) {
            const auto before = QueryNumber(request, "before", 0, std::int64_t{1} << 53);
            const auto limit = static_cast<int>(QueryNumber(request, "limit", 100, kMaxListed));
            const bool views = QueryNumber(request, "views", 1, 1) == 1;
            return JsonResponse({{"entries", audit.Audit({before, limit, "", views})}});
          })
      .Discloses("view.log");
  routes
      .ReadInBackground("/api/v1/audit.jsonl", Permission::kAudit,
                        [&audit](const Request&) {
                          return Download("application/x-ndjson", audit.ExportAudit(),
                                          "plumb_log.jsonl");
                        })
      .Discloses("", "download.log");
  routes.Read("/api/v1/settings", Permission::kView, [&settings](const Request&) {
    return JsonResponse(SettingsAs<Json>(settings.GetSettings()));
  });
  routes.Write("PUT", "/api/v1/settings", Permission::kSettings, BodyKind::kJson,
               [&settings](const Request& request, const Done& done) {
                 settings.ChangeSettings(request.actor(), ParseSettingsChange(request.body), done);
               });
}

void AddUpdateRoutes(Routes& routes, UpdateService& updates) {
  routes.Read("/api/v1/update", Permission::kView, [&updates](const Request&) {
    Json answer = updates.GetUpdate();
    answer["stick"] = updates.StickBundles();
    return JsonResponse(answer);
  });
  routes.Write("POST", "/api/v1/update", Permission::kUpdate, BodyKind::kJson,
               [&updates](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string bundle = fields.Text("bundle", 1, 64);
                 const bool from_stick = fields.Has("from_stick") && fields.Flag("from_stick");
                 fields.Finish();
                 if (!IsName(bundle)) throw DataError(say::web::BundleListed());
                 if (from_stick) return updates.InstallFromStick(request.actor(), bundle, done);
                 updates.InstallUpdate(request.actor(), bundle, done);
               });
  routes.Write("POST", "/api/v1/update/bundles/{name}", Permission::kUpdate, BodyKind::kFile,
               [&updates](const Request& request, const Done& done) {
                 const std::string& name = request.arguments[0];
                 if (!name.ends_with(".raucb")) throw DataError(say::web::BundleName());
                 updates.AddBundle(request.actor(), request.upload->path(), name,
                                   KeepingUpload(request, done));
               });
  routes.Write("POST", "/api/v1/update/seen", Permission::kUpdate, BodyKind::kNone,
               [&updates](const Request& request, const Done& done) {
                 updates.ForgetRollBack(request.actor(), done);
               });
  routes.Write("DELETE", "/api/v1/update/bundles/{name}", Permission::kUpdate, BodyKind::kNone,
               [&updates](const Request& request, const Done& done) {
                 updates.RemoveBundle(request.actor(), request.arguments[0], done);
               });
}

void AddMessageRoutes(Routes& routes, ApplianceService& appliance,
                      MaintenanceService& maintenance) {
  routes.Read("/api/v1/messages", Permission::kSettings, [&appliance](const Request&) {
    return JsonResponse({{"ways", appliance.GetStatus().messages}});
  });
  routes.Write("POST", "/api/v1/messages/test", Permission::kSettings, BodyKind::kNone,
               [&maintenance](const Request& request, const Done& done) {
                 maintenance.SendTestMessage(request.actor(), done);
               });
}

void AddMaintenanceRoutes(Routes& routes, MaintenanceService& maintenance, AuditLog& audit) {
  routes.ReadInBackground("/api/v1/backup", Permission::kSettings, [&audit](const Request&) {
    return JsonResponse({{"last", LastEntry(audit, "backup.make")},
                         {"verified", LastEntry(audit, "backup.verify")}});
  });
  routes.Write("POST", "/api/v1/backup/verified", Permission::kSettings, BodyKind::kNone,
               [&maintenance](const Request& request, const Done& done) {
                 maintenance.NoteBackupVerified(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/backup", Permission::kSettings, BodyKind::kNone,
               [&maintenance](const Request& request, const Done& done) {
                 maintenance.MakeBackup(request.actor(), done);
               });
  routes.Add("POST", "/api/v1/diagnostics", Permission::kDiagnostics, BodyKind::kNone,
             [&maintenance](const Request& request, const Respond& respond) {
               maintenance.WriteDiagnostics(request.actor(), [respond](const Change& change) {
                 if (change.result != ChangeResult::kDone) return respond(ChangeResponse(change));
                 Response response =
                     FileResponse(change.file, "application/octet-stream",
                                  "plumb-diagnostics" + change.file.extension().string());
                 std::error_code ignored;
                 std::filesystem::remove(change.file,
                                         ignored);  // stays readable through the open descriptor
                 respond(std::move(response));
               });
             });
}

}  // namespace

void AddUnitApi(Routes& routes, const Services& services) {
  AddApplianceRoutes(routes, services.appliance);
  AddSettingsRoutes(routes, services.settings, services.audit);
  AddUpdateRoutes(routes, services.updates);
  AddMessageRoutes(routes, services.appliance, services.maintenance);
  AddMaintenanceRoutes(routes, services.maintenance, services.audit);
}

}  // namespace plumb::web
