// SPDX-License-Identifier: Apache-2.0
// Scans, their files, results and daily checks.
#include "web/api/all_routes.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/model/limits.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"
#include "words/store.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

/// The files of a scan that can be downloaded, and their places in its folder.
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
    ScanFile{"deformation.ply", "result/deformation.ply", "application/octet-stream"},
    ScanFile{"scene.json", "scene/scene.json", "application/json"},
    ScanFile{"heightmap.tiff", "scene/heightmap.tiff", "image/tiff"},
    ScanFile{"mesh.ply", "scene/mesh.ply", "application/octet-stream"},
    ScanFile{"cloud.ply", "scene/cloud.ply", "application/octet-stream"},
    ScanFile{"trajectory.txt", "scene/trajectory.txt", "text/plain; charset=utf-8"},
};

std::optional<ComparisonPicture> PictureNamed(std::string_view name) {
  if (name == "error_map.png") return ComparisonPicture::kErrorMap;
  if (name == "overlay.png") return ComparisonPicture::kOverlay;
  return std::nullopt;
}

/// Name of the downloaded file; empty if the client wants to show it.
std::string DownloadName(const Request& request) {
  return request.query.contains("download")
             ? fmt::format("{}_{}", request.arguments[0], request.arguments[1])
             : std::string();
}

/// The picture in the requested language. Nothing if none is requested, the file is not a picture,
/// or it cannot be drawn: then the stored file is sent.
std::optional<Response> TranslatedPicture(ScanService& scans, const Request& request) {
  const std::optional<ComparisonPicture> picture = PictureNamed(request.arguments[1]);
  if (!picture || !request.query.contains("language")) return std::nullopt;
  auto png = scans.PictureOf(request.arguments[0], *picture, LanguageIn(request));
  if (!png) return std::nullopt;
  Response response = BodyResponse("image/png", std::move(*png));
  NameDownload(response, DownloadName(request));
  return response;
}

Response ScanFileResponse(ScanService& scans, const std::string& scan_id, std::string_view name,
                          const std::string& download_name) {
  const auto scan = scans.FindScan(scan_id);
  if (!scan) return ErrorResponse(404, say::store::NoScan());
  for (const ScanFile& file : kScanFiles) {
    if (file.name != name) continue;
    if (scan->folder.empty()) return ErrorResponse(404, say::web::ScanFilesGone());
    return FileResponse(scan->folder / file.path, file.type, download_name);
  }
  return ErrorResponse(404, say::web::ScanHasNoSuchFile());
}

void AddScanRoutes(Routes& routes, ScanService& scans) {
  routes
      .ReadInBackground(
          "/api/v1/scans", Permission::kView,
          [&scans](const Request& request) {
            const auto limit =
                static_cast<int>(QueryNumber(request, "limit", kMaxListed, kMaxListed));
            return JsonResponse({{"scans", ListJson(scans.Scans("", limit), WallClock::now())}});
          })
      .Discloses("view.scans");
  routes
      .Read("/api/v1/scans/{id}", Permission::kRoom,
            [&scans](const Request& request) {
              const auto scan = scans.FindScan(request.arguments[0]);
              return scan ? JsonResponse(ToJson(*scan, WallClock::now()))
                          : ErrorResponse(404, say::store::NoScan());
            })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, say::store::NoScan());
  routes
      .ReadInBackground("/api/v1/scans/{id}/quality", Permission::kRoom,
                        [&scans](const Request& request) {
                          if (!scans.FindScan(request.arguments[0]))
                            return ErrorResponse(404, say::store::NoScan());
                          return JsonResponse(ToJson(scans.QualityOf(request.arguments[0])));
                        })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, say::store::NoScan());
  routes.Write("DELETE", "/api/v1/scans/{id}", Permission::kWipe, BodyKind::kJson,
               [&scans](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string reason = fields.Text("reason", kMinReason, kMaxReason);
                 fields.Finish();
                 scans.RemoveScan(request.actor(), request.arguments[0], reason, done);
               });
  routes.Write("POST", "/api/v1/scans/{id}/accept", Permission::kAccept, BodyKind::kNone,
               [&scans](const Request& request, const Done& done) {
                 scans.AcceptScan(request.actor(), request.arguments[0], /*reason=*/{}, done);
               });
}

void AddScanFileRoutes(Routes& routes, ScanService& scans) {
  routes
      .ReadInBackground("/api/v1/scans/{id}/files/{name}", Permission::kRoom,
                        [&scans](const Request& request) {
                          if (auto picture = TranslatedPicture(scans, request))
                            return std::move(*picture);
                          return ScanFileResponse(scans, request.arguments[0], request.arguments[1],
                                                  DownloadName(request));
                        })
      .Discloses("view.scan", "download.file")
      .ShowsDisplays(ShownRecord::kScanFile, say::store::NoScan());
  routes
      .ReadInBackground("/api/v1/scans/{id}/maps/{name}", Permission::kRoom,
                        [&scans](const Request& request) {
                          auto map = scans.CompactMap(request.arguments[0], request.arguments[1]);
                          if (!map) return ErrorResponse(404, say::web::ScanHasNoSuchMap());
                          return BodyResponse("application/octet-stream", std::move(*map));
                        })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, say::web::ScanHasNoSuchMap());
  routes
      .ReadInBackground("/api/v1/results/{id}", Permission::kRoom,
                        [&scans](const Request& request) {
                          return ScanFileResponse(scans, request.arguments[0], "result.json",
                                                  /*download_name=*/"");
                        })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, say::store::NoScan());
}

void AddCheckRoutes(Routes& routes, CheckService& checks) {
  routes.ReadInBackground("/api/v1/checks", Permission::kView, [&checks](const Request&) {
    return JsonResponse(ToJson(checks.GetChecks(), WallClock::now()));
  });
  routes.Write("POST", "/api/v1/checks/open", Permission::kScan, BodyKind::kNone,
               [&checks](const Request& request, const Done& done) {
                 checks.OpenCheck(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/checks/leave", Permission::kScan, BodyKind::kNone,
               [&checks](const Request& request, const Done& done) {
                 checks.LeaveCheck(request.actor(), done);
               });
}

}  // namespace

void AddScanApi(Routes& routes, const Services& services) {
  AddScanRoutes(routes, services.scans);
  AddScanFileRoutes(routes, services.scans);
  AddCheckRoutes(routes, services.checks);
}

}  // namespace plumb::web
