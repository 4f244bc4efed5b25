#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "daemon/cli/commands.hpp"
#include "daemon/cli/progress.hpp"
#include "drivers/simulated/suite.hpp"

namespace plumb {
namespace {

struct Options {
  SimulateOptions simulate;
  std::string format = "tum", noise = "nominal", size = "640x480";
};

int Run(const Options& options, const CommandContext& context) {
  SimulateOptions simulate = options.simulate;
  simulate.noise = ParseNoiseLevel(options.noise).value_or(simulate.noise);
  simulate.format = options.format == "oni" ? RecordingFormat::kOni : RecordingFormat::kTum;
  if (options.size == "320x240") simulate.width = 320, simulate.height = 240;
  Progress progress;
  SimulateSuite(simulate, context.stop, [&](double fraction, std::string_view what) { progress.Update("simulating", fraction, what); });
  progress.Clear();
  PrintOut(fmt::format("{}: suite '{}', noise {}, seed {}\n", simulate.out.string(), simulate.suite, options.noise, simulate.seed));
  return kDone;
}

}  // namespace

Command AddSimulate(CLI::App& app) {
  auto options = std::make_shared<Options>();
  SimulateOptions& simulate = options->simulate;
  app.add_option("--suite", simulate.suite,
                 "demo: a reference and a moved body; nine: nine placements, 72 pairs; patient: arm moved, belly and chest deformed")
      ->required()
      ->check(CLI::IsMember({"demo", "nine", "patient"}))
      ->type_name("demo|nine|patient");
  app.add_option("--out", simulate.out, "Suite folder to write: recordings/, truth/, suite.json")->required()->type_name("DIR");
  app.add_option("--seed", simulate.seed, "Of everything random")->capture_default_str()->type_name("N");
  app.add_option("--format", options->format, "Of the recordings: folders in the TUM RGB-D layout, or lossless .oni files of OpenNI2")
      ->check(CLI::IsMember({"tum", "oni"}))
      ->capture_default_str()
      ->type_name("tum|oni");
  app.add_option("--noise", options->noise, "Of sensor, calibration and hand")
      ->check(CLI::IsMember({"ideal", "nominal", "hard"}))
      ->capture_default_str()
      ->type_name("ideal|nominal|hard");
  app.add_option("--frames", simulate.frames, "Frames a scene")->check(CLI::Range(2, 10000))->capture_default_str()->type_name("N");
  app.add_option("--rate", simulate.rate_hz, "Frames a second")->check(CLI::Range(1.0, 120.0))->capture_default_str()->type_name("HZ");
  app.add_option("--size", options->size, "Of the images")
      ->check(CLI::IsMember({"640x480", "320x240"}))
      ->capture_default_str()
      ->type_name("640x480|320x240");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
