// SPDX-License-Identifier: Apache-2.0
// Patients, their sessions, references and templates of plans.
#include "web/api/all_routes.hpp"

#include "algo/base/errors.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/http/checks.hpp"
#include "web/model/limits.hpp"
#include "web/model/patient.hpp"
#include "web/model/wall_clock.hpp"
#include "words/store.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

void AddPatientRoutes(Routes& routes, PatientService& patients) {
  routes
      .ReadInBackground("/api/v1/patients", Permission::kView,
                        [&patients](const Request&) {
                          return JsonResponse({{"patients", patients.Patients()}});
                        })
      .Discloses("view.patients");
  routes.Write("POST", "/api/v1/patients", Permission::kPatients, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string code = fields.Text("code", 1, kMaxName),
                                   site = fields.Text("site", 0, kMaxSite);
                 fields.Finish();
                 if (!IsName(code)) throw DataError(say::web::PatientCode());
                 patients.AddPatient(request.actor(), code, site, done);
               });
  routes
      .Read("/api/v1/patients/{id}", Permission::kRoom,
            [&patients](const Request& request) {
              const auto patient = patients.FindPatient(request.arguments[0]);
              return patient ? JsonResponse(*patient) : ErrorResponse(404, say::store::NoPatient());
            })
      .Discloses("view.patient")
      .ShowsDisplays(ShownRecord::kPatient, say::store::NoPatient());
  routes.Write("PUT", "/api/v1/patients/{id}", Permission::kPatients, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const auto sheet = [&](const char* name) {
                   return fields.Has(name) ? std::optional(fields.Text(name, 0, kMaxNote))
                                           : std::nullopt;
                 };
                 const CourseNotes wanted{.site = fields.Text("site", 0, kMaxSite),
                                          .note = fields.Text("note", 0, kMaxNote),
                                          .immobilisation = sheet("immobilisation"),
                                          .alert = sheet("alert")};
                 std::optional<CourseNotes> shown;
                 if (fields.Has("site_before") || fields.Has("note_before"))
                   shown = CourseNotes{.site = fields.Text("site_before", 0, kMaxSite),
                                       .note = fields.Text("note_before", 0, kMaxNote),
                                       .immobilisation = sheet("immobilisation_before"),
                                       .alert = sheet("alert_before")};
                 fields.Finish();
                 patients.ChangePatient(request.actor(), request.arguments[0], wanted, shown, done);
               });
  routes.Write("POST", "/api/v1/patients/{id}/archive", Permission::kPlan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const bool archived = fields.Flag("archived");
                 fields.Finish();
                 patients.ArchivePatient(request.actor(), request.arguments[0], archived, done);
               });
}

/// The photo is what the sensor sees when a person asks for it; a browser sends none.
void AddPhotoRoutes(Routes& routes, PatientService& patients, ApplianceService& appliance) {
  routes
      .ReadInBackground("/api/v1/patients/{id}/photo", Permission::kView,
                        [&patients](const Request& request) {
                          const auto photo = patients.Photo(request.arguments[0]);
                          return photo ? BodyResponse("image/jpeg", *photo)
                                       : ErrorResponse(404, say::store::NoPhoto());
                        })
      .Discloses("view.photo");
  routes.Write("POST", "/api/v1/patients/{id}/photo", Permission::kPatients, BodyKind::kNone,
               [&patients, &appliance](const Request& request, const Done& done) {
                 auto take = appliance.Photographer();
                 if (!take)
                   return done(Refused(ChangeResult::kConflict, say::web::NoCameraImage()));
                 patients.SetPhoto(request.actor(), request.arguments[0], std::move(take), done);
               });
  routes.Write("DELETE", "/api/v1/patients/{id}/photo", Permission::kPatients, BodyKind::kNone,
               [&patients](const Request& request, const Done& done) {
                 patients.SetPhoto(request.actor(), request.arguments[0], {}, done);
               });
}

std::vector<DrawnPoint> DrawnIn(Fields& fields) {
  std::vector<DrawnPoint> points;
  for (const auto& point : fields.Points("points", 3, kMaxDrawnPoints)) {
    for (const double value : point)
      if (!(value >= 0 && value <= 1)) throw DataError(say::web::FieldRange("points", 0, 1, value));
    points.push_back({.x = point[0], .y = point[1], .begins = point[2] > 0.5});
  }
  return points;
}

void AddDrawingRoutes(Routes& routes, PatientService& patients) {
  routes
      .ReadInBackground("/api/v1/patients/{id}/drawing", Permission::kView,
                        [&patients](const Request& request) {
                          Json points = Json::array();
                          for (const auto& [x, y, begins] : patients.Drawing(request.arguments[0]))
                            points.push_back({x, y, begins ? 1 : 0});
                          return JsonResponse({{"points", std::move(points)}});
                        })
      .Discloses("view.drawing");
  routes.Write("PUT", "/api/v1/patients/{id}/drawing", Permission::kPatients, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::vector<DrawnPoint> points = DrawnIn(fields);
                 const int revision = fields.Integer("sheet_revision", 0, 999'999'999);
                 fields.Finish();
                 patients.SetDrawing(request.actor(), request.arguments[0], points, revision, done);
               });
}

void AddSessionRoutes(Routes& routes, PatientService& patients) {
  routes.Write("POST", "/api/v1/patients/{id}/open", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const ScanPurpose purpose = ParsePurpose(fields.Text("purpose", 1, 32));
                 const std::string reason = fields.Text("reason", 0, kMaxReason);
                 const std::string replaces =
                     fields.Has("replaces") ? fields.Text("replaces", 0, 64) : std::string();
                 fields.Finish();
                 patients.OpenPatient(request.actor(), request.arguments[0], purpose, reason,
                                      replaces, [done](Change change) {
                                        // the status states which session is open
                                        change.id.clear();
                                        done(change);
                                      });
               });
  routes.Write("POST", "/api/v1/treatment/resume", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string session = fields.Text("session_id", 1, 64),
                                   replaces = fields.Text("replaces", 0, 64);
                 fields.Finish();
                 patients.ResumeSession(request.actor(), session, replaces, [done](Change change) {
                   change.id.clear();  // the status states which session is open
                   done(change);
                 });
               });
  routes.Write("POST", "/api/v1/treatment/wristband", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string session = fields.Text("session_id", 1, 64),
                                   code = fields.Text("code", 1, 64);
                 fields.Finish();
                 patients.ConfirmWristband(request.actor(), session, code, done);
               });
  routes.Write("POST", "/api/v1/treatment/reference", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string session = fields.Text("session_id", 1, 64),
                                   reference = fields.Text("reference_id", 1, 64);
                 fields.Finish();
                 patients.UseReference(request.actor(), session, reference, done);
               });
  routes.Write("POST", "/api/v1/treatment/close", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string session = fields.Text("session_id", 0, 64);
                 fields.Finish();
                 patients.CloseSession(request.actor(), session, done);
               });
}

void AddCourseRoutes(Routes& routes, PatientService& patients, ReferenceService& references,
                     ScanService& scans) {
  routes
      .ReadInBackground(
          "/api/v1/patients/{id}/references", Permission::kView,
          [&patients, &references](const Request& request) {
            if (!patients.FindPatient(request.arguments[0]))
              return ErrorResponse(404, say::store::NoPatient());
            return JsonResponse({{"references", references.References(request.arguments[0])}});
          })
      .Discloses("view.patient");
  routes
      .ReadInBackground(
          "/api/v1/patients/{id}/scans", Permission::kView,
          [&patients, &scans](const Request& request) {
            if (!patients.FindPatient(request.arguments[0]))
              return ErrorResponse(404, say::store::NoPatient());
            return JsonResponse({{"scans", ListJson(scans.Scans(request.arguments[0], kMaxListed),
                                                    WallClock::now())}});
          })
      .Discloses("view.patient");
}

void AddTemplateRoutes(Routes& routes, SettingsService& settings) {
  routes.Read("/api/v1/templates", Permission::kView, [&settings](const Request&) {
    return JsonResponse({{"templates", settings.Templates()}});
  });
  routes.Write("PUT", "/api/v1/templates", Permission::kPlan, BodyKind::kJson,
               [&settings](const Request& request, const Done& done) {
                 settings.SetTemplate(request.actor(), ParseTemplate(request.body), done);
               });
  routes.Write("POST", "/api/v1/templates/remove", Permission::kPlan, BodyKind::kJson,
               [&settings](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string site = fields.Text("site", 1, kMaxSite);
                 fields.Finish();
                 settings.RemoveTemplate(request.actor(), site, done);
               });
}

void AddReferenceRoutes(Routes& routes, ReferenceService& references) {
  routes.Write("POST", "/api/v1/references", Permission::kPlan, BodyKind::kJson,
               [&references](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string scan_id = fields.Text("scan_id", 1, 64),
                                   reason = fields.Text("reason", 0, kMaxReason);
                 fields.Finish();
                 references.AddReference(request.actor(), scan_id, reason, done);
               });
  routes
      .ReadInBackground("/api/v1/references/{id}", Permission::kRoom,
                        [&references](const Request& request) {
                          const auto reference = references.FindReference(request.arguments[0]);
                          if (!reference) return ErrorResponse(404, say::store::NoReference());
                          Json json = *reference;
                          json["room"] = references.RoomOfReference(*reference);
                          return JsonResponse(json);
                        })
      .Discloses("view.reference")
      .ShowsDisplays(ShownRecord::kReference, say::store::NoReference());
  routes.Write("PUT", "/api/v1/references/{id}/plan", Permission::kPlan, BodyKind::kJson,
               [&references](const Request& request, const Done& done) {
                 const auto [plan, revision] = ParsePlan(request.body);
                 references.PlanReference(request.actor(), request.arguments[0], revision, plan,
                                          done);
               });
}

}  // namespace

void AddPatientApi(Routes& routes, const Services& services) {
  AddPatientRoutes(routes, services.patients);
  AddPhotoRoutes(routes, services.patients, services.appliance);
  AddDrawingRoutes(routes, services.patients);
  AddSessionRoutes(routes, services.patients);
  AddCourseRoutes(routes, services.patients, services.references, services.scans);
  AddTemplateRoutes(routes, services.settings);
  AddReferenceRoutes(routes, services.references);
}

}  // namespace plumb::web
