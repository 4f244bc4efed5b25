// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/units.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/progress.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/simulator/suites/live_scenes.hpp"
#include "drivers/simulator/suites/suite.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

struct Switch {
  simulated::Fault fault;
  bool on;
};

struct SimulateArguments {
  SimulateOptions simulate;
  std::string format = "tum", noise = "nominal", size = "640x480", sensor = "structured_light",
              lens = "plain";
  std::vector<Switch> switches;
};

/// @throws CLI::CallForHelp for "list", CLI::ValidationError for anything but NAME=on and NAME=off.
Switch ParseSwitch(const std::string& text) {
  if (text == "list") throw CLI::CallForHelp();
  const std::size_t equals = text.find('=');
  const std::string state = equals == std::string::npos ? "" : text.substr(equals + 1);
  if (state != "on" && state != "off")
    throw CLI::ValidationError(
        "--fault", fmt::format("expected NAME=on, NAME=off or list, found \"{}\"", text));
  const std::string name = text.substr(0, equals);
  const std::optional<simulated::Fault> fault = simulated::ParseFault(name);
  if (!fault)
    throw CLI::ValidationError(
        "--fault", fmt::format("there is no fault \"{}\"; `plumb simulate --fault list` prints all "
                               "names",
                               name));
  return {*fault, state == "on"};
}

// All names, the levels at which each is on, and a line of description.
std::string FaultList() {
  using simulated::NoiseLevel;
  const simulated::FaultSet mild = simulated::MildFaults(NoiseLevel::kNominal);
  const simulated::FaultSet nominal = simulated::FaultsOf(NoiseLevel::kNominal);
  const simulated::FaultSet hard = simulated::FaultsOf(NoiseLevel::kHard);
  std::string list = fmt::format("Faults:\n  {:<20} {:<20} {}\n", "NAME", "on for", "what it does");
  for (const simulated::FaultEntry& entry : simulated::AllFaults()) {
    const char* levels = mild.Has(entry.fault)      ? "demo, nominal, hard"
                         : nominal.Has(entry.fault) ? "nominal, hard"
                         : hard.Has(entry.fault)    ? "hard"
                                                    : "nothing";
    list += fmt::format("  {:<20} {:<20} {}\n", entry.name, levels, entry.about);
  }
  return list;
}

int Run(const SimulateArguments& options, const CommandContext& context) {
  SimulateOptions simulate = options.simulate;
  simulate.noise = Named<simulated::NoiseLevel>(options.noise).value_or(simulate.noise);
  simulate.sensor = Named<DepthSensor>(options.sensor).value_or(simulate.sensor);
  simulate.format = options.format == "oni" ? RecordingFormat::kOni : RecordingFormat::kTum;
  simulate.lens = Named<simulated::LensKind>(options.lens).value_or(simulate.lens);
  if (options.size == "320x240") simulate.width = 320, simulate.height = 240;
  if (options.size == "848x480") simulate.width = 848;
  simulated::FaultSet faults = FaultsOf(simulate);
  for (const auto& [fault, on] : options.switches) faults.Set(fault, on);
  simulate.faults = faults;
  if (const RecordingKind* kind = BuiltInSensors().KindWithExtension(".oni")) {
    simulate.write_oni = [kind](const auto& file, FrameSource& source, const auto&... rest) {
      kind->Write(file, source, rest..., /*jpeg=*/false);
    };
  }
  Progress progress(context.language);
  SimulateSuite(simulate, context.stop, [&](double fraction, std::string_view what) {
    progress.Update(say::cli::Simulating(), fraction, Message::Verbatim(what));
  });
  progress.Clear();
  PrintOut(context.Said(say::cli::Simulated(simulate.out.string(), simulate.suite, options.noise,
                                            simulate.seed, simulate.unit.value_or(simulate.seed))) +
           "\n");
  return kDone;
}

/// What concerns the suite `ct` alone.
void AddCtOptions(CLI::App& app, const std::shared_ptr<SimulateArguments>& options) {
  app.add_option_function<double>(
         "--ct-spacing",
         [options](double spacing_mm) {
           options->simulate.ct_spacing_m = spacing_mm * kMillimetre;
         },
         "Suite ct: distance of the slices in millimetres; default: 3")
      ->check(CLI::Range(0.5, 20.0))
      ->type_name("MM");
  app.add_option_function<double>(
         "--ct-skin",
         [options](double sigma_mm) { options->simulate.ct_skin_m = sigma_mm * kMillimetre; },
         "Suite ct: standard deviation, in millimetres, of how far the contours lie outside the "
         "skin; default: 0")
      ->check(CLI::Range(0.0, 5.0))
      ->type_name("MM");
  app.add_flag("--ct-images", options->simulate.ct_images,
               "Suite ct: write the CTs as images, with a couch beneath the body, in place of "
               "structure sets");
  app.add_option_function<std::vector<std::string>>(
         "--ct-quirk",
         [options](const std::vector<std::string>& names) {
           for (const std::string& name : names)
             options->simulate.ct_quirks.push_back(Named<simulated::CtQuirk>(name).value());
         },
         "Suite ct: what planning systems do; may be repeated")
      ->check(CLI::IsMember(std::vector<std::string>(kNamesOf<simulated::CtQuirk>.begin(),
                                                     kNamesOf<simulated::CtQuirk>.end())))
      ->type_name("NAME")
      ->expected(1)
      ->take_all();
}

/// How many images, and of what size.
void AddImageOptions(CLI::App& app, const std::shared_ptr<SimulateArguments>& options) {
  SimulateOptions& simulate = options->simulate;
  app.add_option("--frames", simulate.frames, "Frames per scene")
      ->check(CLI::Range(2, 10000))
      ->capture_default_str()
      ->type_name("N");
  app.add_option("--rate", simulate.rate_hz, "Frames per second")
      ->check(CLI::Range(1.0, 120.0))
      ->capture_default_str()
      ->type_name("HZ");
  app.add_option("--size", options->size, "Size of the images")
      ->check(CLI::IsMember({"640x480", "320x240", "848x480"}))
      ->capture_default_str()
      ->type_name("640x480|320x240|848x480");
}

void AddUnitOptions(CLI::App& app, const std::shared_ptr<SimulateArguments>& options) {
  app.add_option(
         "--unit", options->simulate.unit,
         "The sensor unit. Default: that of the seed; the demo's default unit has only mild "
         "faults, as the virtual sensor has")
      ->type_name("N");
  app.add_option("--sensor", options->sensor, "Class of the depth camera")
      ->check(CLI::IsMember(
          std::vector<std::string>(kNamesOf<DepthSensor>.begin(), kNamesOf<DepthSensor>.end())))
      ->capture_default_str()
      ->type_name("structured_light|active_stereo|time_of_flight|lidar");
  app.add_option("--lens", options->lens,
                 "Lens of the colour camera: OpenCV's plain or rational model, or a fisheye")
      ->check(CLI::IsMember({"plain", "rational", "fisheye"}))
      ->capture_default_str()
      ->type_name("plain|rational|fisheye");
}

}  // namespace

Command AddSimulate(CLI::App& app) {
  auto options = std::make_shared<SimulateArguments>();
  SimulateOptions& simulate = options->simulate;
  app.add_option(
         "--suite", simulate.suite,
         "demo: a reference and a moved body; nine: nine placements, 72 pairs; small: ten "
         "placements within 10 mm and 2 deg, 90 pairs; patient: arm moved, belly and chest "
         "deformed; ct: those of small, compared with a planning CT in four positions; live: a "
         "sensor at rest over a body that breathes and moves")
      ->required()
      ->check(CLI::IsMember({"demo", "nine", "small", "patient", "ct", "live"}))
      ->type_name("demo|nine|small|patient|ct|live");
  app.add_option("--out", simulate.out, "Suite folder to write: recordings/, truth/, suite.json")
      ->required()
      ->type_name("DIR");
  app.add_option("--seed", simulate.seed, "Seed of room, body, placements and sweep")
      ->capture_default_str()
      ->type_name("N");
  AddUnitOptions(app, options);
  app.add_option_function<std::vector<std::string>>(
         "--fault",
         [options](const std::vector<std::string>& texts) {
           for (const std::string& text : texts) options->switches.push_back(ParseSwitch(text));
         },
         "Switch one fault of sensor, hand or room; may be repeated; list: print all names")
      ->type_name("NAME=on|off")
      ->expected(1)
      ->take_all();
  AddCtOptions(app, options);
  app.footer(FaultList());
  app.add_option(
         "--format", options->format,
         "Format of the recordings: folders in the TUM RGB-D layout, or lossless .oni files")
      ->check(CLI::IsMember({"tum", "oni"}))
      ->capture_default_str()
      ->type_name("tum|oni");
  app.add_option("--noise", options->noise, "Noise level of sensor, calibration and sweep")
      ->check(CLI::IsMember({"ideal", "nominal", "hard"}))
      ->capture_default_str()
      ->type_name("ideal|nominal|hard");
  app.add_option("--live", simulate.live,
                 "Of the suite live, only these recordings; default: all of them")
      ->check(CLI::IsMember(simulated::LiveNames()))
      ->type_name("NAME");
  app.add_option("--live-seconds", simulate.live_s, "Length of the recordings of the suite live")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str()
      ->type_name("S");
  AddImageOptions(app, options);
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
