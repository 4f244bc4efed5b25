// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/sensor_calibration/profile_gate.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/sensor_profile_file.hpp"
#include "daemon/pipeline/learning_gate.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

struct CalibrateArguments {
  std::vector<std::filesystem::path> recordings;
  std::filesystem::path out;
  MethodOptions method;
  bool json = false;
};

// Why a sweep is left out; empty if the profile learns from it.
Message WhyLeftOut(const Scene& scene, const std::optional<SensorProfile>& before,
                   const std::optional<SensorProfile>& learned, const AcceptanceLimits& limits) {
  if (!learned) return say::cli::NotBetter();
  if (Message why = WhyNotLearned(scene, std::nullopt, limits); !why.empty()) return why;
  if (!before) return {};
  const ProfileAgreement agreement = Agreement(*before, *learned);
  if (agreement.agrees()) return {};
  return say::cli::ContradictsProfile(agreement.chi_square, agreement.limit, agreement.num_terms);
}

int Run(const CalibrateArguments& options, const CommandContext& context) {
  Config config = options.method.Read();
  if (config.reconstruct.preset == Preset::kPaper)
    throw InvalidRequest(say::cli::PaperLearnsNothing());
  Progress progress(context.language);
  std::vector<Message> left_out;
  for (const std::filesystem::path& path : options.recordings) {
    const std::unique_ptr<FrameSource> recording = OpenRecording(path, config.markers);
    std::optional<SensorProfile> learned;
    config.reconstruct.on_learned = [&](const SensorProfile& profile) { learned = profile; };
    const Scene scene =
        RunScan(*recording, {.reconstructor = config.reconstruct}, context.stop,
                [&](const ScanProgress& scan) { Show(progress, path.filename().string(), scan); });
    const Message why =
        WhyLeftOut(scene, config.reconstruct.profile, learned, config.compare.limits);
    if (why.empty()) {
      config.reconstruct.profile = std::move(learned);
    } else {
      left_out.push_back(say::cli::LeftOut(path.string(), why));
    }
  }
  progress.Clear();
  for (const Message& reason : left_out) fmt::print(stderr, "{}\n", context.Said(reason));
  if (left_out.size() == options.recordings.size()) throw DataError(say::cli::NothingLearned());
  const SensorProfile& profile = *config.reconstruct.profile;
  WriteSensorProfile(profile, options.out);
  PrintOut(options.json ? SensorProfileJson(profile)
                        : fmt::format("{}\n  {} {}\n", options.out.string(),
                                      LeftAligned(context.Said(say::cli::Sweeps()), 10),
                                      profile.num_sweeps));
  return kDone;
}

}  // namespace

Command AddCalibrate(CLI::App& app) {
  auto options = std::make_shared<CalibrateArguments>();
  app.add_option(
         "recordings", options->recordings,
         "Ordinary sweeps by one sensor unit over any scenes with markers; several are better")
      ->required()
      ->type_name("RECORDING");
  app.add_option("--out", options->out, "Profile to write")->required()->type_name("PROFILE");
  options->method.AddTo(app);
  options->method.AddSensorTo(app);
  app.add_flag("--json", options->json, "Print the profile on the standard output");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
