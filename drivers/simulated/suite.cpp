#include "drivers/simulated/suite.hpp"

#include <unistd.h>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "drivers/simulated/suite_plan.hpp"
#include "drivers/simulated/truth_writer.hpp"

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
      throw DataError(
          fmt::format("cannot simulate into {}: expected a new or empty folder, found something "
                      "there; choose another --out",
                      name.string()));
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
  for (const auto& scene : plan.scenes) scenes.push_back(scene.name);
  nlohmann::json pairs = nlohmann::json::array();
  for (const auto& [reference, current] : plan.pairs) pairs.push_back({reference, current});
  const nlohmann::json simulated{
      {"seed", options.seed},         {"unit", plan.unit.seed},
      {"noise", Name(options.noise)}, {"frames", options.frames},
      {"rate_hz", options.rate_hz},   {"faults", plan.unit.faults.Names()}};
  const nlohmann::json suite{
      {"name", plan.name}, {"scenes", scenes}, {"pairs", pairs}, {"simulated", simulated}};
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

}  // namespace

simulated::FaultSet FaultsOf(const SimulateOptions& options) {
  if (options.faults) return *options.faults;
  const bool mild = options.suite == "demo" && !options.unit;
  return mild ? simulated::MildFaults(options.noise) : simulated::FaultsOf(options.noise);
}

void SimulateSuite(const SimulateOptions& options, const std::stop_token& stop,
                   const std::function<void(double fraction, std::string_view what)>& progress) {
  if (options.format == RecordingFormat::kOni && !options.write_oni)
    throw std::invalid_argument(
        "cannot write .oni files: this build has no OpenNI2; use the format tum");
  FolderBeside folder(options.out);
  const simulated::SuitePlan plan = simulated::PlanSuite(options);
  const double total = static_cast<double>(plan.scenes.size()) * options.frames;
  double done = 0;
  for (std::size_t i = 0; i < plan.scenes.size(); ++i) {
    const std::string& name = plan.scenes[i].name;
    FolderBeside::Make(folder.path() / "recordings");
    FolderBeside::Make(folder.path() / "truth" / name);
    const auto source = simulated::MakeSource(plan, i);
    simulated::VertexSightings sightings(plan, i);
    const auto each = [&] {
      sightings.Add(source->truth());
      done += 1;
      if (progress) progress(done / total, name);
      if (stop.stop_requested())
        throw Interrupted(
            fmt::format("simulation stopped after {} of {} frames; nothing is left in {}", done,
                        total, options.out.string()));
    };
    if (options.format == RecordingFormat::kOni)
      options.write_oni(folder.path() / "recordings" / (name + ".oni"), *source, stop, each);
    else
      WriteTumRecording(folder.path() / "recordings" / name, plan.unit, *source, each);
    simulated::WriteTruth(folder.path() / "truth" / name, plan, i, *source, sightings.counts());
  }
  simulated::WriteUnit(folder.path() / "truth" / "unit.json", plan.unit);
  WriteSuiteFile(folder.path(), plan, options);
  folder.Commit();
}

}  // namespace plumb
