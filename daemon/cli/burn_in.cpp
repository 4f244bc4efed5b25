#include "daemon/cli/burn_in.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <fstream>
#include <memory>
#include <optional>
#include <random>
#include <string_view>
#include <vector>

#include "algo/base/errors.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/config/config.hpp"
#include "daemon/pipeline/scan_runner.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "drivers/simulated/suite.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kDiskBytes = 64 << 20;
constexpr std::size_t kMemoryBytes = 128 << 20;
constexpr int kLeastRounds = 2;
constexpr double kSlowedDown = 2.0;  // ratio of the slowest to the fastest round

template <typename Value>
void Append(std::string& bytes, const std::vector<Value>& values) {
  bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
}

/// All deterministic results of two sweeps and their comparison.
std::string ScanOnce(const fs::path& suite, const std::stop_token& stop) {
  const Config config;
  const auto scene = [&](const char* name) {
    const std::unique_ptr<FrameSource> recording =
        OpenRecording(suite / "recordings" / name, config.markers);
    return RunScan(*recording, {.reconstructor = config.reconstruct}, stop);
  };
  const Comparison comparison = Compare(scene("reference"), scene("moved"), config.compare);
  if (!comparison.correction || !comparison.deviation)
    return "no answer: " +
           (comparison.reasons.empty() ? std::string() : comparison.reasons.front());
  std::string bytes;
  Append(bytes, comparison.deviation->z);
  const CouchNumbers& numbers = comparison.correction->value;
  for (const double number :
       {numbers.vertical_mm.value_or(0.0), numbers.longitudinal_mm.value_or(0.0),
        numbers.lateral_mm.value_or(0.0), numbers.pitch_deg, numbers.roll_deg, numbers.yaw_deg})
    bytes += fmt::format("{:a} ", number);
  return bytes;
}

/// Temperature of the hottest zone that the kernel lists, in degrees Celsius.
std::optional<double> Temperature() {
  std::optional<double> hottest;
  std::error_code error;
  for (const fs::directory_entry& zone : fs::directory_iterator("/sys/class/thermal", error)) {
    std::ifstream file(zone.path() / "temp");
    double milli = 0.0;
    if (file >> milli) hottest = std::max(hottest.value_or(-273.0), milli / 1000.0);
  }
  return hottest;
}

/// The sensor's status as reported by plumbd.
struct SensorLook {
  bool present = false;
  std::int64_t pairs = 0, lost = 0;
};
std::optional<SensorLook> CheckSensor(const fs::path& control, const std::stop_token& stop) {
  constexpr int kTimeoutMs = 2000;
  try {
    const nlohmann::json answer =
        AskPlumbd(control, {.kind = ControlRequest::Kind::kStatus, .action = {}, .argument = {}},
                  stop, kTimeoutMs);
    const nlohmann::json& sensor = answer.at("sensor");
    return SensorLook{.present = sensor.at("present").get<bool>(),
                      .pairs = sensor.at("pairs").get<std::int64_t>(),
                      .lost = sensor.at("lost").get<std::int64_t>()};
  } catch (const DeviceError&) {
    return std::nullopt;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  }
}

/// One burn-in with the results of its rounds so far.
class Rounds {
 public:
  Rounds(const BurnInOptions& options, const std::stop_token& stop, fs::path folder)
      : options_(options),
        stop_(stop),
        folder_(std::move(folder)),
        sensor_before_(CheckSensor(options.control, stop)) {}

  void Run(Progress& progress) {
    const auto begin = Clock::now();
    const auto seconds = [](auto span) { return std::chrono::duration<double>(span).count(); };
    for (; seconds(Clock::now() - begin) < 60.0 * options_.minutes || count_ < kLeastRounds;) {
      if (stop_.stop_requested()) throw Interrupted("the burn-in was not finished");
      progress.Update("burn-in",
                      std::min(1.0, seconds(Clock::now() - begin) / (60.0 * options_.minutes)),
                      fmt::format("round {}", count_ + 1));
      const auto start = Clock::now();
      Once();
      const double took_s = seconds(Clock::now() - start);
      fastest_s_ = count_ == 1 ? took_s : std::min(fastest_s_, took_s);
      slowest_s_ = std::max(slowest_s_, took_s);
    }
  }

  void Report(DoctorReport& report) const {
    const std::string work =
        fmt::format("{} rounds, {:.1f} to {:.1f} s each", count_, fastest_s_, slowest_s_);
    Report(report, "processor", scan_fault_, work + "; each gave the same bits",
           "the processor or its memory computes wrongly: do not use this unit");
    if (slowest_s_ > kSlowedDown * fastest_s_)
      report.Note("speed", work, "something slows the processor: heat, or another program");
    Report(report, "memory", memory_fault_, fmt::format("{} MB a round", kMemoryBytes >> 20),
           "replace the memory");
    Report(report, "disk", disk_fault_, fmt::format("{} MB a round, read back", kDiskBytes >> 20),
           "replace the disk, or free space on it");
    if (hottest_c_)
      report.Good("temperature", fmt::format("{:.0f} degrees Celsius at most", *hottest_c_));
    ReportSensor(report);
  }

 private:
  using Clock = std::chrono::steady_clock;

  void Once() {
    ++count_;
    const std::string result = ScanOnce(folder_ / "suite", stop_);
    if (count_ == 1) first_ = result;
    Keep(scan_fault_, result.starts_with("no answer") ? result : FirstDifference(first_, result));
    const auto seed = static_cast<std::uint64_t>(count_);
    Keep(memory_fault_, TestMemory(kMemoryBytes, seed));
    Keep(disk_fault_, TestDisk(folder_, kDiskBytes, seed));
    if (const std::optional<double> now_c = Temperature())
      hottest_c_ = std::max(hottest_c_.value_or(*now_c), *now_c);
    if (sensor_before_ && sensor_before_->present) {
      const std::optional<SensorLook> now = CheckSensor(options_.control, stop_);
      if (!now || !now->present) Keep(sensor_fault_, "it was gone");
    }
  }

  void Keep(std::string& kept, const std::string& fault) const {
    if (kept.empty() && !fault.empty()) kept = fmt::format("round {}: {}", count_, fault);
  }

  static void Report(DoctorReport& report, const char* what, const std::string& fault,
                     const std::string& good, const char* remedy) {
    if (fault.empty()) {
      report.Good(what, good);
    } else {
      report.Bad(what, fault, remedy);
    }
  }

  void ReportSensor(DoctorReport& report) const {
    if (!sensor_before_ || !sensor_before_->present)
      return report.Note("sensor", "not part of this burn-in",
                         "start plumbd with its sensor to have it watched");
    if (!sensor_fault_.empty())
      return report.Bad("sensor", sensor_fault_, "look at its cable and its power");
    const SensorLook now = CheckSensor(options_.control, stop_).value_or(*sensor_before_);
    report.Good("sensor",
                fmt::format("attached all the time; {} frames, {} lost",
                            now.pairs - sensor_before_->pairs, now.lost - sensor_before_->lost));
  }

  const BurnInOptions& options_;
  const std::stop_token& stop_;
  const fs::path folder_;
  const std::optional<SensorLook> sensor_before_;
  int count_ = 0;
  double fastest_s_ = 0.0, slowest_s_ = 0.0;
  std::string first_, scan_fault_, memory_fault_, disk_fault_, sensor_fault_;
  std::optional<double> hottest_c_;
};

}  // namespace

std::string FirstDifference(const std::string& first, const std::string& now) {
  if (first.size() != now.size())
    return fmt::format("the same scan gave {} bytes instead of {}", now.size(), first.size());
  const auto differ = std::mismatch(first.begin(), first.end(), now.begin()).first;
  if (differ == first.end()) return {};
  return fmt::format("the same scan gave another result, from byte {} on", differ - first.begin());
}

std::string TestMemory(std::size_t bytes, std::uint64_t seed,
                       const std::function<void(std::uint64_t*, std::size_t)>& between) {
  std::vector<std::uint64_t> words(bytes / sizeof(std::uint64_t));
  for (const bool inverted : {false, true}) {
    std::mt19937_64 random(seed);
    for (std::uint64_t& word : words) word = inverted ? ~random() : random();
    if (between) between(words.data(), words.size());
    random.seed(seed);
    for (std::size_t i = 0; i < words.size(); ++i) {
      const std::uint64_t expected = inverted ? ~random() : random();
      if (words[i] != expected)
        return fmt::format("wrote {:016x} and read {:016x}", expected, words[i]);
    }
  }
  return {};
}

std::string TestDisk(const fs::path& folder, std::size_t bytes, std::uint64_t seed,
                     const std::function<void(const fs::path&)>& between) try {
  std::string written(bytes, '\0');
  std::mt19937_64 random(seed);
  for (std::size_t i = 0; i + sizeof(std::uint64_t) <= bytes; i += sizeof(std::uint64_t)) {
    const std::uint64_t word = random();
    std::copy_n(reinterpret_cast<const char*>(&word), sizeof(word), written.begin() + i);
  }
  const fs::path file = folder / "disk-test";
  WriteWholeFile(file, written);
  SyncToDisk(file);
  if (const int fd = ::open(file.c_str(), O_RDONLY | O_CLOEXEC); fd >= 0) {
    // otherwise memory is read instead of the disk
    (void)::posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
    ::close(fd);
  }
  if (between) between(file);
  const std::string read = ReadTextFile(file, bytes);
  fs::remove(file);
  return read == written ? "" : fmt::format("{} does not hold what was written", file.string());
} catch (const std::exception& error) {
  return error.what();
}

void BurnIn(const BurnInOptions& options, const std::stop_token& stop, DoctorReport& report) try {
  const TemporaryFolder work(options.folder, ".burn-in-");
  Progress progress;
  SimulateOptions simulate;
  simulate.out = work.path() / "suite";
  simulate.frames = options.frames;
  simulate.width = 320;
  simulate.height = 240;
  SimulateSuite(simulate, stop, [&](double fraction, std::string_view what) {
    progress.Update("simulating", fraction, what);
  });
  Rounds rounds(options, stop, work.path());
  rounds.Run(progress);
  progress.Clear();
  rounds.Report(report);
} catch (const IoError& error) {
  report.Bad("burn-in", error.what(), "name a folder with --burn-in-folder", kInternalError);
}

}  // namespace plumb
