// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/suite.hpp"

#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulator/suites/ct_images.hpp"
#include "drivers/simulator/suites/dicom_writer.hpp"
#include "drivers/simulator/suites/suite_plan.hpp"
#include "drivers/simulator/suites/truth_writer.hpp"
#include "words/simulator.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// A folder beside the final one, which is removed unless it was renamed.
class FolderBeside {
 public:
  explicit FolderBeside(const fs::path& out) : out_(out) {
    fs::path name = out.has_filename() ? out : out.parent_path();
    out_ = name;
    std::error_code error;
    if (fs::exists(name, error) && !(fs::is_directory(name, error) && fs::is_empty(name, error))) {
      throw DataError(say::simulator::FolderUsed(name.string()));
    }
    if (name.has_parent_path()) fs::create_directories(name.parent_path(), error);
    if (error) throw IoError(DescribeWriteError(name.parent_path(), error.value()));
    name += fmt::format(".partial-{}", ::getpid());
    beside_ = name;
    Make(beside_);
  }
  ~FolderBeside() {
    std::error_code ignored;
    if (!beside_.empty()) fs::remove_all(beside_, ignored);
  }
  FolderBeside(const FolderBeside&) = delete;
  FolderBeside& operator=(const FolderBeside&) = delete;

  static void Make(const fs::path& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) throw IoError(DescribeWriteError(folder, error.value()));
  }
  [[nodiscard]] const fs::path& path() const { return beside_; }
  void Commit() {
    std::error_code error;
    fs::rename(beside_, out_, error);  // Replaces an empty folder.
    if (error) throw IoError(DescribeWriteError(out_, error.value()));
    beside_.clear();
  }

 private:
  fs::path out_;
  fs::path beside_;
};

void WriteSuiteFile(const fs::path& folder, const simulated::SuitePlan& plan,
                    const SimulateOptions& options) {
  nlohmann::json scenes = nlohmann::json::array();
  nlohmann::json live = nlohmann::json::array();
  for (const auto& ct : plan.cts) scenes.push_back(ct.name);
  for (std::size_t i = 0; i < plan.scenes.size(); ++i)
    (i < plan.num_sweeps ? scenes : live).push_back(plan.scenes[i].name);
  nlohmann::json pairs = nlohmann::json::array();
  for (const auto& [reference, current] : plan.pairs) pairs.push_back({reference, current});
  const nlohmann::json simulated{{"seed", options.seed},
                                 {"unit", plan.unit.seed},
                                 {"noise", Name(options.noise)},
                                 {"frames", options.frames},
                                 {"rate_hz", options.rate_hz},
                                 {"sensor", Name(options.sensor)},
                                 {"faults", plan.unit.faults.Names()}};
  nlohmann::json suite{
      {"name", plan.name}, {"scenes", scenes}, {"pairs", pairs}, {"simulated", simulated}};
  if (!live.empty()) suite["live"] = live;
  if (!plan.live_together.empty()) suite["live_together"] = plan.live_together;
  WriteWholeFile(folder / "suite.json", suite.dump(1));
}

void WriteTumRecording(const fs::path& folder, const simulated::SensorUnit& unit,
                       SimulatedSource& source, const std::function<void()>& each) {
  TumWriter writer(folder, source.info(),
                   {.depth_scale = unit.depth_units_per_metre, .jpeg_quality = unit.jpeg_quality});
  while (const std::optional<Frame> frame = source.Next()) {
    writer.Add(*frame);
    each();
  }
  writer.Finish();
}

void WriteCtImages(const StructureSet& structures, const simulated::PlanningCtOptions& options,
                   const fs::path& folder) {
  FolderBeside::Make(folder);
  int number = 0;
  simulated::MakeCtImages(structures, options, {}, [&](const CtImage& image) {
    WriteWholeFile(folder / fmt::format("{:04}.dcm", ++number),
                   std::string_view(DicomBytes(image)));
  });
}

// The planning CTs as a planning system would export them, and the room that they are compared in.
void WriteCts(const fs::path& suite, const simulated::SuitePlan& plan, bool with_images) {
  for (const simulated::CtPlan& ct : plan.cts) {
    const fs::path folder = suite / "recordings" / ct.name, truth = suite / "truth" / ct.name;
    FolderBeside::Make(folder);
    FolderBeside::Make(truth);
    const auto [structures, treatment] =
        simulated::MakePlanningCt(ct.body->surface, plan.T_iec_world * ct.T_world_body, ct.options);
    WriteWholeFile(folder / "plan.dcm", std::string_view(DicomBytes(treatment)));
    if (with_images)
      WriteCtImages(structures, ct.options, folder / "images");
    else
      WriteWholeFile(folder / "structures.dcm", std::string_view(DicomBytes(structures)));
    simulated::WriteTruth(truth, plan, ct);
  }
  if (plan.cts.empty()) return;
  FolderBeside::Make(suite / "room");
  simulated::WriteRoom(suite, plan);
}

}  // namespace

void SimulateSuite(const SimulateOptions& options, const std::stop_token& stop,
                   const std::function<void(double fraction, std::string_view what)>& progress) {
  if (options.format == RecordingFormat::kOni && !options.write_oni)
    throw std::invalid_argument(
        "cannot write .oni files: this build has no OpenNI2; use the format tum");
  FolderBeside folder(options.out);
  const simulated::SuitePlan plan = simulated::PlanSuite(options);
  double total = 0;
  for (const auto& scene : plan.scenes) total += scene.sweep.num_frames;
  double done = 0;
  for (std::size_t i = 0; i < plan.scenes.size(); ++i) {
    const std::string& name = plan.scenes[i].name;
    FolderBeside::Make(folder.path() / "recordings");
    FolderBeside::Make(folder.path() / "truth" / name);
    const auto source = simulated::MakeSource(plan, i);
    const bool live = i >= plan.num_sweeps;
    simulated::VertexSightings sightings(plan, i);
    simulated::LiveTruth live_truth(plan.scenes[i]);
    const auto each = [&] {
      if (live)
        live_truth.Add(source->truth());
      else
        sightings.Add(source->truth());
      done += 1;
      if (progress) progress(done / total, name);
      if (stop.stop_requested())
        throw Interrupted(say::simulator::Stopped(done, total, options.out.string()));
    };
    if (options.format == RecordingFormat::kOni)
      options.write_oni(folder.path() / "recordings" / (name + ".oni"), *source, stop, each);
    else
      WriteTumRecording(folder.path() / "recordings" / name, plan.unit, *source, each);
    const std::filesystem::path truth = folder.path() / "truth" / name;
    if (live)
      live_truth.Write(truth, plan);
    else
      simulated::WriteTruth(truth, plan, i, *source, sightings.counts());
  }
  WriteCts(folder.path(), plan, options.ct_images);
  simulated::WriteUnit(folder.path() / "truth" / "unit.json", plan.unit);
  WriteSuiteFile(folder.path(), plan, options);
  folder.Commit();
}

}  // namespace plumb
