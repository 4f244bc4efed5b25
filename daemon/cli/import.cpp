// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

struct ImportArguments {
  std::filesystem::path source, out;
  MethodOptions method;
  std::optional<double> rate_hz;
  bool jpeg = false;
};

/// Stamps in steps that the files hold: sources may have finer ones.
class RisingStamps {
 public:
  void Apply(Frame& frame) {
    color_s_ = frame.color_time_s = std::max(frame.color_time_s, color_s_ + kStampStep_s);
    depth_s_ = frame.depth_time_s = std::max(frame.depth_time_s, depth_s_ + kStampStep_s);
  }

 private:
  double color_s_ = -1.0, depth_s_ = -1.0;
};

int Run(const ImportArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  AtomicFolder folder(options.out, RecordingOutput());
  const std::unique_ptr<FrameSource> source =
      OpenRecording(options.source, config.markers, options.rate_hz);
  // Markers that the configuration states are stated; its other values reach the source above.
  StreamInfo info = source->info();
  info.dictionary_assumed = info.dictionary_assumed && !config.markers.dictionary;
  info.marker_length_assumed = info.marker_length_assumed && !config.markers.length_m;
  // 0.2 mm, and 13 m: as fine as the finest sensor, as far as the farthest.
  TumWriter writer(folder.path(), info,
                   {.depth_scale = 5000.0, .jpeg_quality = options.jpeg ? 92 : 0});
  Progress progress(context.language);
  std::int64_t num_frames = 0;
  RisingStamps rising;
  while (std::optional<Frame> frame = source->Next()) {
    if (context.stop.stop_requested()) throw Interrupted(say::cli::Importing());
    rising.Apply(*frame);
    writer.Add(*frame);
    ++num_frames;
    const auto all = static_cast<double>(std::max<std::int64_t>(1, info.num_frames.value_or(1)));
    progress.Update(say::cli::Importing(), static_cast<double>(num_frames) / all);
  }
  progress.Update(say::cli::Writing(), 1.0);
  writer.Finish();
  folder.Commit();
  progress.Clear();
  std::string text =
      context.Said(say::cli::RecordingImported(options.out.string(), num_frames)) + "\n";
  for (const Message& warning : info.warnings)
    text += fmt::format("  {} {}\n", LeftAligned(context.Said(say::cli::WarningLabel()), 10),
                        context.Said(warning));
  PrintOut(text);
  return kDone;
}

}  // namespace

Command AddImport(CLI::App& app) {
  auto options = std::make_shared<ImportArguments>();
  app.add_option(
         "source", options->source,
         "Recording of another program: a bag of RealSense, ROS 1 or ROS 2 (.bag, .db3, .mcap), "
         "an Azure Kinect's .mkv, a ScanNet .sens, or a folder of images with a "
         "calibration; or any recording")
      ->required()
      ->type_name("SOURCE");
  app.add_option("--out", options->out, "Recording to write: a folder in the TUM RGB-D layout")
      ->required()
      ->type_name("FOLDER");
  app.add_option("--rate", options->rate_hz,
                 "Images a second, for folders of images without time stamps")
      ->check(CLI::Range(1.0, 120.0))
      ->type_name("HZ");
  app.add_flag("--jpeg", options->jpeg, "Colour as JPEG: much smaller, but not lossless");
  app.add_option("--config", options->method.config_file, "Markers of the room, as TOML")
      ->type_name("FILE");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
