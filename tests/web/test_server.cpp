// SPDX-License-Identifier: Apache-2.0
// The real HTTP server over a fake appliance whose scans show real results: for tests of the page
// in a browser. plumb_web_test_server FOLDER: makes scenes and results in FOLDER, prints its
// address and "setup code: XXXX-XXXX", obeys lines on stdin: unplug, plug, fail (of the running
// scan), nobackup (backups fail), encrypts (backups are for a key), overdue (no check has passed,
// references are blocked), checked, slow (long sweeps), fast, toil (long computing), swift (half a
// second from the start to the result), old (the last result becomes 10 minutes old), restarted
// (the status names no last result), plugged (another bundle is on the stick), quit; of what the
// next scan shows: markermoved and markerunseen (a check), stranger (another body), shoulder
// (lifted), across (the body lies across the room's axes), "moved AXIS AMOUNT POSTURE" (the body
// moved along x, y, z by mm or turned by pitch, roll, yaw by degrees); hole (in the region),
// shifted (one marker, by 12 mm), weak (roll is not well seen), hurried (a third of the frames
// lost); "room known", "room unknown", "room lasers": what the status says; "moved z 8 HFS bare":
// as compared where the room is not known; cold, warm (the sensor); full, emptied (the disk);
// "peers open", "peers silent", "peers nothing".
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>

#include "daemon/files/compact_map.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/planning/planning_import.hpp"
#include "daemon/reports/scan_quality.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/simulator/suites/ct_images.hpp"
#include "drivers/simulator/suites/dicom_writer.hpp"
#include "drivers/simulator/suites/planning_ct.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "tests/support/fake_appliance.hpp"
#include "tests/web/commands.hpp"
#include "tests/web/recorder.hpp"
#include "web/api/http_server.hpp"

namespace plumb::test {
namespace {

namespace fs = std::filesystem;

/// Lines that have come on stdin; "quit" once it is closed.
std::vector<std::string> ReadCommands(std::string& rest) {
  std::array<char, 1024> buffer{};
  const ssize_t count = read(STDIN_FILENO, buffer.data(), buffer.size());
  if (count <= 0) return {"quit"};
  rest.append(buffer.data(), static_cast<std::size_t>(count));
  std::vector<std::string> lines;
  for (std::size_t end; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1))
    lines.push_back(rest.substr(0, end));
  return lines;
}

/// Of a sensor whose fourth sweep showed another focal length.
SensorProfiles KnownSensor() {
  const auto learned = [](int version, double focal) {
    const int age_days = 30 - 7 * version;
    return SensorProfileVersion{.version = version,
                                .made_at = WallClock::now() - std::chrono::hours(24 * age_days),
                                .cause = ProfileCause::kLearned,
                                .num_sweeps = version,
                                .values = {{"focal_x_scale", focal},
                                           {"focal_y_scale", focal},
                                           {"depth_scale", 1.0123},
                                           {"depth_offset_m", -0.0042},
                                           {"color_readout_s", 0.0267}}};
  };
  return {.serial = "17110415",
          .why_none = {},
          .versions = {learned(4, 0.981), learned(3, 1.0046), learned(2, 1.0045)}};
}

/// The files of a small planning CT for the browser to send.
void WritePlanning(const fs::path& root) {
  const simulated::SuitePlan demo = simulated::PlanSuite({});
  const simulated::ScenePlan& scene = demo.scenes.front();
  Pose T_iec_body = scene.T_world_body;
  T_iec_body.pretranslate(Eigen::Vector3d(0, 0, -0.1));
  T_iec_body.prerotate(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  for (const auto& [name, quirks] :
       {std::pair{"", std::vector<simulated::CtQuirk>{}},
        {"several-", std::vector{simulated::CtQuirk::kSeveralExternal}}}) {
    const auto [structures, plan] =
        simulated::MakePlanningCt(scene.body->surface, T_iec_body, {.quirks = quirks});
    WriteWholeFile(root / (std::string(name) + "structures.dcm"),
                   std::string_view(DicomBytes(structures)));
    WriteWholeFile(root / (std::string(name) + "plan.dcm"), std::string_view(DicomBytes(plan)));
  }
  fs::create_directory(root / "images");
  const simulated::PlanningCtOptions options{.spacing_m = 0.005,
                                             .quirks = {simulated::CtQuirk::kShort}};
  const auto planned = simulated::MakePlanningCt(scene.body->surface, T_iec_body, options);
  // A few about the isocentre: they are read on the loop of this server.
  simulated::MakeCtImages(planned.first, options, {.pixel_mm = 2.4},
                          [&, number = 100](const CtImage& image) mutable {
                            if (std::abs(image.origin_mm.z() - options.isocentre_mm.z()) > 30)
                              return;
                            WriteWholeFile(root / "images" / fmt::format("{}.dcm", number++),
                                           std::string_view(DicomBytes(image)));
                          });
}

/// The import of what the browser sends; in the place of received files are those of above.
void ServePlanning(FakeAppliance& service, const fs::path& root) {
  WritePlanning(root);
  service.import_planning = [root, number = 0](const web::SentPlanning& sent) mutable {
    const fs::path folder = root / fmt::format("planned-{}", ++number);
    fs::create_directories(folder);
    PlanningFiles files{.structures = folder / "structures.dcm",
                        .plan = folder / "plan.dcm",
                        .structures_name = "STRUCTURES",
                        .plan_name = "PLAN"};
    const SentParts parts{.structures_bytes = sent.structures_bytes, .plan_bytes = sent.plan_bytes};
    PlanningImages images = ImagesIn({root / "images"}, sent.threshold_hu.value_or(0), {});
    if (sent.file.empty()) {  // received, not sent
      fs::copy_file(root / "structures.dcm", files.structures);
      fs::copy_file(root / "plan.dcm", files.plan);
    } else {
      SplitPlanning(sent.file, parts, files);
      images.for_each = [&](const CtImageVisit& visit) {
        ForEachSentImage(sent.file, parts, folder / "image.dcm", visit);
      };
    }
    if (sent.threshold_hu && (sent.file.empty() || parts.structures_bytes == 0))
      files.structures.clear();
    PlanningChoice choice;
    if (!sent.roi.empty()) choice.roi = sent.roi;
    const ReadPlan read = sent.threshold_hu ? ReadPlanningWithImages(files, images, choice)
                                            : ReadPlanning(files, choice);
    WriteScene(read.scene, folder / "scene");
    return folder;
  };
  service.skin_of_images = [](const Scan& scan) -> std::optional<double> {
    if (!IsSceneFolder(scan.folder / "scene")) return std::nullopt;
    const auto planning = ReadStoredScene(scan.folder / "scene").scene.planning;
    return planning ? planning->skin_threshold_hu : std::nullopt;
  };
}

/// The surface so far, in a hundred steps of the sweep: making it takes longer than serving it.
/// @param shown  What is shown of it now.
void ShowSurface(FakeAppliance& service, Recorder& recorder,
                 std::optional<std::pair<int, bool>>& shown) {
  if (service.status.state != ApplianceState::kScanning) return;
  constexpr int kSteps = 100;
  const std::pair now(static_cast<int>(std::min(1.0, service.swept) * kSteps),
                      service.status.scan->purpose == ScanPurpose::kFraction);
  if (shown == now) return;
  shown = now;
  service.surface = std::make_shared<const std::string>(
      SurfaceAt(recorder.reference(), static_cast<double>(now.first) / kSteps, now.second));
}

int Serve(const fs::path& root, bool tls) {
  FakeAppliance service;
  Recorder recorder(root);
  // Each takes a second to make: all but the reference only for tests that show them.
  for (int number = 0; number < kNumSweeps; ++number)
    service.recorded.emplace_back([&recorder, number] {
      return recorder.Once(fmt::format("sweep {}", number), [number] { return Sweep(number); });
    });
  service.recorded.front()();
  service.make_map = [](const fs::path& folder,
                        const std::string& name) -> std::optional<std::string> {
    try {
      return CompactMap(folder, name);
    } catch (const std::exception&) {
      return std::nullopt;
    }
  };
  service.judge_quality = [](const Scan& scan) {
    return QualityOf(scan, FilesOf(scan), /*warm_up_min=*/20);
  };
  service.status.room.right_xy = {kT_iec_reference(0, 0), kT_iec_reference(0, 1)};
  service.status.room.gantry_xy = {kT_iec_reference(1, 0), kT_iec_reference(1, 1)};
  service.status.room.is_known = true;
  ServePlanning(service, root);
  service.sweep = std::chrono::milliseconds(1500);
  service.profiles = KnownSensor();
  service.update.supported = true;
  service.update.message = {};
  service.update.slot = "A";
  service.update.bundles = {"plumb-0.2.0.raucb"};
  web::HttpServerOptions options;
  options.password_memory_bytes = 1 << 20;
  options.password_operations = 1;
  options.upload_folder = root / "updates";
  options.max_upload_bytes = 64 << 20;
  if (tls) {
    options.make_certificate = [authority = web::MakeAuthority({})](const auto now) {
      return web::IssueTlsIdentity(authority, {}, now);
    };
    options.tls = options.make_certificate(std::chrono::system_clock::now());
    options.keep_certificate = [](const web::TlsIdentity&) {};
  }
  web::HttpServer server(service.services(), options);
  fmt::print("{}://127.0.0.1:{}/\nsetup code: {}\n", tls ? "https" : "http", server.port(),
             server.setup_code().value_or(""));
  std::fflush(stdout);
  std::string rest;
  std::optional<std::pair<int, bool>> shown;
  while (true) {
    std::array<pollfd, 2> waiting = {pollfd{server.fd(), POLLIN, 0},
                                     pollfd{STDIN_FILENO, POLLIN, 0}};
    const auto wait = server.timeout();
    poll(waiting.data(), waiting.size(),
         static_cast<int>(std::min<std::int64_t>(wait ? wait->count() : 50, 50)));
    if (waiting[1].revents != 0) {
      for (const std::string& command : ReadCommands(rest)) {
        if (command == "quit") return 0;
        Obey(service, recorder, command);
      }
    }
    service.Tick(std::chrono::steady_clock::now());
    ShowSurface(service, recorder, shown);
    server.Run();
  }
}

}  // namespace
}  // namespace plumb::test

int main(int argc, char** argv) {
  const bool tls = argc == 3 && std::string_view(argv[2]) == "tls";
  if (argc != 2 && !tls) {
    std::fprintf(stderr, "usage: plumb_web_test_server FOLDER [tls]\n");
    return 2;
  }
  return plumb::test::Serve(argv[1], tls);
}
