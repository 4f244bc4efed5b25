#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/units.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/files/scene_json.hpp"
#include "daemon/pipeline/scan_runner.hpp"

namespace plumb {
namespace {

struct ReconstructArguments {
  std::filesystem::path recording, out;
  MethodOptions method;
  bool realtime = false;
  bool json = false;
};

std::string BreathingText(const Breathing& breathing) {
  if (breathing.amplitude_m > 0.0)
    return fmt::format("rose by {:.1f} mm (standard deviation {:.1f} mm) every {:.1f} s",
                       breathing.amplitude_m / kMillimetre, breathing.sigma_m / kMillimetre,
                       breathing.period_s);
  return fmt::format("none found; a rise of {:.1f} mm or more would have been",
                     breathing.limit_m / kMillimetre);
}

std::string Summary(const Scene& scene, const std::filesystem::path& out) {
  std::string text = fmt::format("{}\n", out.string());
  text +=
      fmt::format("  frames     {} of {} tracked, {} dropped; {} keyframes\n", scene.frames_tracked,
                  scene.frames_total, scene.frames_dropped, scene.keyframes.size());
  text += fmt::format("  markers    {}", scene.markers.size());
  if (scene.frame == SceneFrame::kReferenceMarker)
    text += fmt::format("; the frame is that of marker {}", scene.reference_marker.value_or(-1));
  text += "\n";
  if (scene.height_map) {
    const GridShape& grid = scene.height_map->grid;
    text += fmt::format("  height map {} x {} cells of {:.3g} mm\n", grid.width, grid.height,
                        grid.step * 1000);
  } else {
    text += scene.frame == SceneFrame::kReferenceMarker
                ? "  height map none: no surface around the reference marker\n"
                : "  height map none: not in the reference marker's frame\n";
  }
  if (scene.breathing) text += fmt::format("  breathing  {}\n", BreathingText(*scene.breathing));
  text += fmt::format("  surface    {} points, {} triangles\n", scene.cloud.size(),
                      scene.mesh.triangles.size());
  if (const auto after = scene.timings_s.find("after_last_frame"); after != scene.timings_s.end()) {
    text += fmt::format("  time       {:.2f} s after the last frame\n", after->second);
  }
  for (const std::string& warning : scene.warnings)
    text += fmt::format("  warning    {}\n", warning);
  return text;
}

int Run(const ReconstructArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  {
    const AtomicFolder check(options.out, SceneOutput());
  }  // rejects a bad place before the long work
  const std::unique_ptr<FrameSource> recording = OpenRecording(options.recording, config.markers);
  Progress progress;
  const Scene scene =
      RunScan(*recording, {.reconstructor = config.reconstruct, .realtime = options.realtime},
              context.stop, [&](const ScanProgress& scan) { Show(progress, "", scan); });
  progress.Update("writing", 0.0);
  WriteScene(scene, options.out);
  progress.Clear();
  PrintOut(options.json ? SceneJson(scene) : Summary(scene, options.out));
  return kDone;
}

}  // namespace

Command AddReconstruct(CLI::App& app) {
  auto options = std::make_shared<ReconstructArguments>();
  app.add_option("recording", options->recording,
                 "Recording: a folder in the TUM RGB-D layout, or an .oni file")
      ->required()
      ->type_name("RECORDING");
  app.add_option("--out", options->out, "Scene folder to write")->required()->type_name("SCENE");
  options->method.AddTo(app);
  options->method.AddSensorTo(app);
  app.add_flag("--realtime", options->realtime,
               "Play the recording at its own pace, dropping frames as a live sensor would");
  app.add_flag("--json", options->json, "Print scene.json on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
