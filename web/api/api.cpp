#include "web/api/api.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <filesystem>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/api/json.hpp"
#include "web/api/look_back.hpp"
#include "web/http/checks.hpp"
#include "web/http/gate.hpp"

namespace plumb::web {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxListed = 200;

/// What can be downloaded of a scan, and from where in its folder.
struct ScanFile {
  std::string_view name;
  std::string_view path;
  std::string_view type;
};
constexpr std::array kScanFiles = {
    ScanFile{"result.json", "result/result.json", "application/json"},
    ScanFile{"error_map.png", "result/error_map.png", "image/png"},
    ScanFile{"overlay.png", "result/overlay.png", "image/png"},
    ScanFile{"deviation.tiff", "result/deviation.tiff", "image/tiff"},
    ScanFile{"deviation_after.tiff", "result/deviation_after.tiff", "image/tiff"},
    ScanFile{"distance.tiff", "result/distance.tiff", "image/tiff"},
    ScanFile{"scene.json", "scene/scene.json", "application/json"},
    ScanFile{"heightmap.tiff", "scene/heightmap.tiff", "image/tiff"},
    ScanFile{"mesh.ply", "scene/mesh.ply", "application/octet-stream"},
    ScanFile{"cloud.ply", "scene/cloud.ply", "application/octet-stream"},
    ScanFile{"trajectory.txt", "scene/trajectory.txt", "text/plain; charset=utf-8"},
};

Response JsonResponse(const Json& json) {
  Response response;
  response.body = Dump(json);
  return response;
}

Done Answer(const Respond& respond) {
  return [respond](const Change& change) { respond(ChangeResponse(change)); };
}

template <typename T>
Json ListJson(const std::vector<T>& items) {
  Json list = Json::array();
  for (const T& item : items) list.push_back(ToJson(item));
  return list;
}

Json ListJson(const std::vector<Scan>& scans) {
  Json list = Json::array();
  for (const Scan& scan : scans) list.push_back(ToJson(scan, WallClock::now()));
  return list;
}

std::int64_t QueryNumber(const Request& request, const std::string& name, std::int64_t otherwise,
                         std::int64_t max) {
  const auto found = request.query.find(name);
  if (found == request.query.end()) return otherwise;
  std::int64_t value = 0;
  const char* const end = found->second.data() + found->second.size();
  const auto [stop, error] = std::from_chars(found->second.data(), end, value);
  if (error != std::errc() || stop != end || value < 0 || value > max) {
    throw DataError(fmt::format("{} must be a whole number from 0 to {}", name, max));
  }
  return value;
}

Response FileResponse(const fs::path& file, std::string_view type,
                      const std::string& download_name) {
  Response response;
  try {
    response.file = std::make_shared<OpenFile>(file);
  } catch (const IoError&) {
    return ErrorResponse(404, "this scan has no such file");
  }
  response.type = std::string(type);
  if (!download_name.empty())
    response.headers.emplace_back("Content-Disposition",
                                  fmt::format("attachment; filename=\"{}\"", download_name));
  return response;
}

Response ScanFileResponse(ScanService& service, const std::string& scan_id, std::string_view name,
                          bool download) {
  const auto scan = service.FindScan(scan_id);
  if (!scan) return ErrorResponse(404, "no such scan");
  for (const ScanFile& file : kScanFiles) {
    if (file.name != name) continue;
    if (scan->folder.empty()) return ErrorResponse(404, "the files of this scan are gone");
    return FileResponse(scan->folder / file.path, file.type,
                        download ? fmt::format("{}_{}", scan_id, name) : "");
  }
  return ErrorResponse(404, "this scan has no such file");
}

/// Adds routes with less to write.
class Table {
 public:
  Table(Router& router, ScanService& service) : router_(router), service_(service) {}

  using Get = Response (*)(ScanService&, const Request&);
  using Change = void (*)(ScanService&, const Request&, const Respond&);

  void Read(const char* pattern, Permission permission, Get get) {
    router_.Add({"GET", pattern, permission, BodyKind::kNone,
                 [this_service = &service_, get](const Request& request, const Respond& respond) {
                   respond(get(*this_service, request));
                 }});
  }
  /// Of lists and files: not on the loop.
  void ReadAside(const char* pattern, Permission permission, Get get) {
    const std::string name = std::string("GET ") + pattern;
    router_.Add(
        {"GET", pattern, permission, BodyKind::kNone,
         [this_service = &service_, name, get](const Request& request, const Respond& respond) {
           RespondAside(
               *this_service, name,
               [this_service, get, request] { return get(*this_service, request); }, respond);
         }});
  }
  void Write(const char* method, const char* pattern, Permission permission, BodyKind body,
             Change change) {
    router_.Add(
        {method, pattern, permission, body,
         [this_service = &service_, change](const Request& request, const Respond& respond) {
           change(*this_service, request, respond);
         }});
  }

 private:
  Router& router_;
  ScanService& service_;
};

void AddApplianceRoutes(Table& table) {
  table.Read("/health", Permission::kNone, [](ScanService& service, const Request&) {
    const Health health = service.GetHealth();
    Response response = JsonResponse(
        health.ok ? Json{{"status", "ok"}} : Json{{"status", "failed"}, {"reason", health.reason}});
    if (!health.ok) response.status = 503;
    return response;
  });
  table.Read("/api/v1/status", Permission::kRoom, [](ScanService& service, const Request&) {
    return JsonResponse(ToJson(service.GetStatus(), WallClock::now()));
  });
  table.Read("/api/v1/preview", Permission::kRoom, [](ScanService& service, const Request&) {
    const auto picture = service.Preview();
    if (!picture) return ErrorResponse(404, "the camera shows nothing now");
    Response response;
    response.type = "image/jpeg";
    response.body = *picture;
    return response;
  });
  table.Write("POST", "/api/v1/press", Permission::kScan, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.Press(request.actor(), Answer(respond));
              });
  table.Write("POST", "/api/v1/scan/start", Permission::kScan, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.StartSweep(request.actor(), Answer(respond));
              });
  table.Write("POST", "/api/v1/scan/end", Permission::kScan, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.EndSweep(request.actor(), Answer(respond));
              });
  table.Write("POST", "/api/v1/cancel", Permission::kScan, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.Cancel(request.actor(), Answer(respond));
              });
}

void AddPatientRoutes(Table& table) {
  table.ReadAside("/api/v1/patients", Permission::kView, [](ScanService& service, const Request&) {
    return JsonResponse({{"patients", ListJson(service.Patients())}});
  });
  table.Write(
      "POST", "/api/v1/patients", Permission::kPatients, BodyKind::kJson,
      [](ScanService& service, const Request& request, const Respond& respond) {
        Fields fields(request.body);
        const std::string code = fields.Text("code", 1, 32),
                          site = fields.Text("site", 0, kMaxSite);
        fields.Finish();
        if (!IsName(code))
          throw DataError("code must be letters, digits, '.', '-' or '_': a pseudonym, no name");
        service.AddPatient(request.actor(), code, site, Answer(respond));
      });
  table.Read(
      "/api/v1/patients/{id}", Permission::kRoom, [](ScanService& service, const Request& request) {
        const auto patient = service.FindPatient(request.arguments[0]);
        return patient ? JsonResponse(ToJson(*patient)) : ErrorResponse(404, "no such patient");
      });
  table.Write("PUT", "/api/v1/patients/{id}", Permission::kPatients, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const std::string site = fields.Text("site", 0, kMaxSite),
                                  note = fields.Text("note", 0, kMaxNote);
                fields.Finish();
                service.ChangePatient(request.actor(), request.arguments[0], site, note,
                                      Answer(respond));
              });
  table.Write("POST", "/api/v1/patients/{id}/archive", Permission::kPlan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const bool archived = fields.Flag("archived");
                fields.Finish();
                service.ArchivePatient(request.actor(), request.arguments[0], archived,
                                       Answer(respond));
              });
  table.Write("DELETE", "/api/v1/patients/{id}", Permission::kWipe, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.WipePatient(request.actor(), request.arguments[0], Answer(respond));
              });
  table.Write("POST", "/api/v1/patients/{id}/open", Permission::kScan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const ScanPurpose purpose = ParsePurpose(fields.Text("purpose", 1, 32));
                const std::string reason = fields.Text("reason", 0, 200);
                const std::string replaces =
                    fields.Has("replaces") ? fields.Text("replaces", 0, 64) : std::string();
                fields.Finish();
                service.OpenPatient(request.actor(), request.arguments[0], purpose, reason,
                                    replaces, [respond](Change change) {
                                      change.id.clear();  // the status says which session is open
                                      respond(ChangeResponse(change));
                                    });
              });
  table.Write("POST", "/api/v1/treatment/close", Permission::kScan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const std::string session = fields.Text("session_id", 0, 64);
                fields.Finish();
                service.CloseSession(request.actor(), session, Answer(respond));
              });
  table.ReadAside(
      "/api/v1/patients/{id}/references", Permission::kView,
      [](ScanService& service, const Request& request) {
        if (!service.FindPatient(request.arguments[0]))
          return ErrorResponse(404, "no such patient");
        return JsonResponse({{"references", ListJson(service.References(request.arguments[0]))}});
      });
  table.ReadAside(
      "/api/v1/patients/{id}/scans", Permission::kView,
      [](ScanService& service, const Request& request) {
        if (!service.FindPatient(request.arguments[0]))
          return ErrorResponse(404, "no such patient");
        return JsonResponse({{"scans", ListJson(service.Scans(request.arguments[0], kMaxListed))}});
      });
}

void AddReferenceRoutes(Table& table) {
  table.Read("/api/v1/templates", Permission::kView, [](ScanService& service, const Request&) {
    return JsonResponse({{"templates", ListJson(service.Templates())}});
  });
  table.Write("PUT", "/api/v1/templates", Permission::kPlan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.SetTemplate(request.actor(), ParseTemplate(request.body), Answer(respond));
              });
  table.Write("POST", "/api/v1/templates/remove", Permission::kPlan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const std::string site = fields.Text("site", 1, kMaxSite);
                fields.Finish();
                service.RemoveTemplate(request.actor(), site, Answer(respond));
              });
  table.Write("POST", "/api/v1/references", Permission::kPlan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const std::string scan_id = fields.Text("scan_id", 1, 64),
                                  reason = fields.Text("reason", 0, 200);
                fields.Finish();
                service.AddReference(request.actor(), scan_id, reason, Answer(respond));
              });
  table.Read("/api/v1/references/{id}", Permission::kRoom,
             [](ScanService& service, const Request& request) {
               const auto reference = service.FindReference(request.arguments[0]);
               return reference ? JsonResponse(ToJson(*reference))
                                : ErrorResponse(404, "no such reference");
             });
  table.Write("PUT", "/api/v1/references/{id}/plan", Permission::kPlan, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                const auto [plan, revision] = ParsePlan(request.body);
                service.PlanReference(request.actor(), request.arguments[0], revision, plan,
                                      Answer(respond));
              });
  table.Write("POST", "/api/v1/references/{id}/approve", Permission::kApprove, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const int revision = fields.Integer("revision", 1, kMaxRevision);
                const std::string digest =
                    fields.Has("digest") ? fields.Text("digest", 0, 64) : std::string();
                fields.Finish();
                service.ApproveReference(request.actor(), request.arguments[0], revision, digest,
                                         Answer(respond));
              });
}

void AddScanRoutes(Table& table) {
  table.ReadAside(
      "/api/v1/scans", Permission::kView, [](ScanService& service, const Request& request) {
        const auto limit = static_cast<int>(QueryNumber(request, "limit", kMaxListed, kMaxListed));
        return JsonResponse({{"scans", ListJson(service.Scans("", limit))}});
      });
  table.Read("/api/v1/scans/{id}", Permission::kRoom,
             [](ScanService& service, const Request& request) {
               const auto scan = service.FindScan(request.arguments[0]);
               return scan ? JsonResponse(ToJson(*scan, WallClock::now()))
                           : ErrorResponse(404, "no such scan");
             });
  table.Write("DELETE", "/api/v1/scans/{id}", Permission::kWipe, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const std::string reason = fields.Text("reason", 3, 200);
                fields.Finish();
                service.RemoveScan(request.actor(), request.arguments[0], reason, Answer(respond));
              });
  table.Write("POST", "/api/v1/scans/{id}/accept", Permission::kAccept, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.AcceptScan(request.actor(), request.arguments[0], /*reason=*/{},
                                   Answer(respond));
              });
  table.ReadAside("/api/v1/scans/{id}/files/{name}", Permission::kRoom,
                  [](ScanService& service, const Request& request) {
                    return ScanFileResponse(service, request.arguments[0], request.arguments[1],
                                            request.query.contains("download"));
                  });
  table.ReadAside("/api/v1/scans/{id}/maps/{name}", Permission::kRoom,
                  [](ScanService& service, const Request& request) {
                    auto map = service.CompactMap(request.arguments[0], request.arguments[1]);
                    if (!map) return ErrorResponse(404, "this scan has no such map");
                    Response response;
                    response.type = "application/octet-stream";
                    response.body = std::move(*map);
                    return response;
                  });
  table.ReadAside(
      "/api/v1/results/{id}", Permission::kRoom, [](ScanService& service, const Request& request) {
        return ScanFileResponse(service, request.arguments[0], "result.json", /*download=*/false);
      });
}

void AddCheckRoutes(Table& table) {
  table.ReadAside("/api/v1/checks", Permission::kView, [](ScanService& service, const Request&) {
    return JsonResponse(ToJson(service.GetChecks(), WallClock::now()));
  });
  table.Write("POST", "/api/v1/checks/open", Permission::kScan, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.OpenCheck(request.actor(), Answer(respond));
              });
  table.Write("POST", "/api/v1/checks/{id}/baseline", Permission::kPlan, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.SetCheckBaseline(request.actor(), request.arguments[0], Answer(respond));
              });
}

void AddCareRoutes(Table& table) {
  table.ReadAside(
      "/api/v1/audit", Permission::kAudit, [](ScanService& service, const Request& request) {
        const auto before = QueryNumber(request, "before", 0, std::int64_t{1} << 53);
        const auto limit = static_cast<int>(QueryNumber(request, "limit", 100, kMaxListed));
        return JsonResponse({{"entries", ListJson(service.Audit(before, limit))}});
      });
  table.Read("/api/v1/settings", Permission::kView, [](ScanService& service, const Request&) {
    return JsonResponse(ToJson(service.GetSettings()));
  });
  table.Write("PUT", "/api/v1/settings", Permission::kSettings, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.ChangeSettings(request.actor(), ParseSettings(request.body),
                                       Answer(respond));
              });
  table.Read("/api/v1/update", Permission::kView, [](ScanService& service, const Request&) {
    return JsonResponse(ToJson(service.GetUpdate()));
  });
  table.Write("POST", "/api/v1/update", Permission::kUpdate, BodyKind::kJson,
              [](ScanService& service, const Request& request, const Respond& respond) {
                Fields fields(request.body);
                const std::string bundle = fields.Text("bundle", 1, 64);
                fields.Finish();
                if (!IsName(bundle)) throw DataError("bundle must be one of the names listed");
                service.InstallUpdate(request.actor(), bundle, Answer(respond));
              });
  table.Write("POST", "/api/v1/update/bundles/{name}", Permission::kUpdate, BodyKind::kFile,
              [](ScanService& service, const Request& request, const Respond& respond) {
                const std::string& name = request.arguments[0];
                if (!name.ends_with(".raucb"))
                  throw DataError("a bundle's name must end with .raucb");
                service.AddBundle(
                    request.actor(), request.upload->path(), name,
                    [respond, kept = request.upload](const plumb::web::Change& change) {
                      respond(ChangeResponse(change));
                    });
              });
  table.Write("POST", "/api/v1/update/seen", Permission::kUpdate, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.ForgetRollBack(request.actor(), Answer(respond));
              });
  table.Write("DELETE", "/api/v1/update/bundles/{name}", Permission::kUpdate, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.RemoveBundle(request.actor(), request.arguments[0], Answer(respond));
              });
  table.ReadAside("/api/v1/backup", Permission::kSettings,
                  [](ScanService& service, const Request&) {
                    const std::optional<AuditEntry> last = LastBackup(service);
                    return JsonResponse({{"last", last ? ToJson(*last) : Json(nullptr)}});
                  });
  table.Write("POST", "/api/v1/backup", Permission::kSettings, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.MakeBackup(request.actor(), Answer(respond));
              });
  table.Write("POST", "/api/v1/diagnostics", Permission::kDiagnostics, BodyKind::kNone,
              [](ScanService& service, const Request& request, const Respond& respond) {
                service.WriteDiagnostics(request.actor(), [respond](const Change& change) {
                  if (change.result != ChangeResult::kDone) return respond(ChangeResponse(change));
                  Response response =
                      FileResponse(change.file, "application/octet-stream",
                                   "plumb-diagnostics" + change.file.extension().string());
                  std::error_code ignored;
                  fs::remove(change.file, ignored);  // stays readable through what is open
                  respond(std::move(response));
                });
              });
}

}  // namespace

void AddApiRoutes(Router& router, ScanService& service) {
  Table table(router, service);
  AddApplianceRoutes(table);
  AddPatientRoutes(table);
  AddReferenceRoutes(table);
  AddScanRoutes(table);
  AddCheckRoutes(table);
  AddCareRoutes(table);
}

}  // namespace plumb::web
