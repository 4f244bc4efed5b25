// The real HTTP server over a fake appliance whose scans show real results: for tests of the page in a browser.
// plumb_web_test_server FOLDER: makes scenes and results in FOLDER, prints its address and "setup code: XXXX-XXXX", obeys lines on stdin:
// unplug, plug, slow (long sweeps), fast, old (the last result becomes 10 minutes old), quit.
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "algo/comparison/comparison.hpp"
#include "algo/reconstruction/surface_mesh.hpp"
#include "daemon/files/result_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "tests/support/fake_scan_service.hpp"
#include "tests/support/synthetic_scene.hpp"
#include "web/http_server.hpp"

namespace plumb::test {
namespace {

namespace fs = std::filesystem;

/// What the sweep shows: a body that was carried, one that lies right, one with its markers covered.
std::vector<SyntheticOptions> Sweeps() {
  const Eigen::Vector3d centre(0.6, 0.45, 0.0);
  SyntheticOptions reference;
  reference.T_reference_body = Pose(Eigen::Translation3d(centre));
  SyntheticOptions moved;
  moved.T_reference_body = BodyMotionAbout(centre, {0.0062, -0.0124, 0.0041}, -2.4, 0.6, -0.5) * reference.T_reference_body;
  moved.seed = 2;
  moved.noise_m = 0.0008;
  SyntheticOptions right = moved;
  right.T_reference_body = BodyMotionAbout(centre, {0.0006, -0.0004, 0.0003}, 0.05) * reference.T_reference_body;
  right.seed = 3;
  SyntheticOptions covered = right;
  for (const auto& [id, marker] : MakeSyntheticScene(reference).markers) covered.hidden_markers.insert(id);
  covered.hidden_markers.erase(covered.hidden_markers.begin());
  return {reference, moved, right, covered};
}

web::SixNumbers Numbers(const CouchNumbers& numbers) {
  return {numbers.vertical_mm, numbers.longitudinal_mm, numbers.lateral_mm, numbers.pitch_deg, numbers.roll_deg, numbers.yaw_deg};
}

std::vector<FakeScanService::Recorded> Record(const fs::path& root) {
  std::vector<FakeScanService::Recorded> recorded;
  std::optional<Scene> reference;
  for (const SyntheticOptions& options : Sweeps()) {
    Scene scene = MakeSyntheticScene(options);
    if (scene.height_map) scene.mesh = MeshOfHeightMap(*scene.height_map, {}, {.decimation = 3});
    const fs::path folder = root / fmt::format("sweep_{}", recorded.size());
    fs::create_directories(folder);
    WriteScene(scene, folder / "scene");
    FakeScanService::Recorded entry{folder, std::nullopt};
    if (!reference) {
      reference = scene;
    } else {
      const Comparison comparison = Compare(*reference, scene);
      WriteResult(comparison, DrawResult(comparison, &*reference->height_map), folder / "result");
      entry.result = web::ResultSummary{Name(comparison.verdict), comparison.reasons, std::nullopt, std::nullopt};
      if (comparison.correction) {
        entry.result->correction = Numbers(comparison.correction->value);
        entry.result->u95 = Numbers(comparison.correction->u95);
      }
    }
    recorded.push_back(entry);
  }
  return recorded;
}

void Obey(FakeScanService& service, const std::string& command) {
  if (command == "unplug") service.Unplug();
  if (command == "plug") service.Plug();
  if (command == "slow") service.sweep = std::chrono::milliseconds(60000);
  if (command == "fast") service.sweep = std::chrono::milliseconds(1500);
  if (command == "old" && !service.scans.empty()) {
    service.scans.back().finished_at = web::WallClock::now() - std::chrono::minutes(10);
    service.status.last_result = service.scans.back();
    service.Tell(web::EventKind::kResult);
  }
}

/// Lines that have come on stdin; "quit" once it is closed.
std::vector<std::string> ReadCommands(std::string& rest) {
  std::array<char, 1024> buffer{};
  const ssize_t count = read(STDIN_FILENO, buffer.data(), buffer.size());
  if (count <= 0) return {"quit"};
  rest.append(buffer.data(), static_cast<std::size_t>(count));
  std::vector<std::string> lines;
  for (std::size_t end; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1)) lines.push_back(rest.substr(0, end));
  return lines;
}

int Serve(const fs::path& root) {
  FakeScanService service;
  service.recorded = Record(root);
  service.sweep = std::chrono::milliseconds(1500);
  service.update = {true, "", "A", false, 0.0, {"plumb-0.2.0.raucb"}};
  web::HttpServerOptions options;
  options.password_memory_bytes = 1 << 20;
  options.password_operations = 1;
  web::HttpServer server(service, options);
  fmt::print("http://127.0.0.1:{}/\nsetup code: {}\n", server.port(), server.setup_code().value_or(""));
  std::fflush(stdout);
  std::string rest;
  while (true) {
    std::array<pollfd, 2> waiting = {pollfd{server.fd(), POLLIN, 0}, pollfd{STDIN_FILENO, POLLIN, 0}};
    const auto wait = server.timeout();
    poll(waiting.data(), waiting.size(), static_cast<int>(std::min<std::int64_t>(wait ? wait->count() : 50, 50)));
    if (waiting[1].revents != 0) {
      for (const std::string& command : ReadCommands(rest)) {
        if (command == "quit") return 0;
        Obey(service, command);
      }
    }
    service.Tick(std::chrono::steady_clock::now());
    server.Run();
  }
}

}  // namespace
}  // namespace plumb::test

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: plumb_web_test_server FOLDER\n");
    return 2;
  }
  return plumb::test::Serve(argv[1]);
}
