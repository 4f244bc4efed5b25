// SPDX-License-Identifier: Apache-2.0
#include "daemon/cli/unit/burn_in.hpp"

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
#include "drivers/simulator/suites/suite.hpp"
#include "words/cli.hpp"
#include "words/doctor.hpp"

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

/// All deterministic results of two sweeps and their comparison, or why there are none.
struct Scanned {
  std::string bytes;
  Message fault;
};
Scanned ScanOnce(const fs::path& suite, const std::stop_token& stop) {
  const Config config;
  const auto scene = [&](const char* name) {
    const std::unique_ptr<FrameSource> recording =
        OpenRecording(suite / "recordings" / name, config.markers);
    return RunScan(*recording, {.reconstructor = config.reconstruct}, stop);
  };
  const Comparison comparison = Compare(scene("reference"), scene("moved"), config.compare);
  if (!comparison.correction || !comparison.deviation)
    return {.bytes = {},
            .fault = say::doctor::NoAnswer(
                comparison.reasons.empty() ? Message() : comparison.reasons.front())};
  std::string bytes;
  Append(bytes, comparison.deviation->z);
  const CouchNumbers& numbers = comparison.correction->value;
  for (const double number :
       {numbers.vertical_mm.value_or(0.0), numbers.longitudinal_mm.value_or(0.0),
        numbers.lateral_mm.value_or(0.0), numbers.pitch_deg, numbers.roll_deg, numbers.yaw_deg})
    bytes += fmt::format("{:a} ", number);
  return {.bytes = std::move(bytes), .fault = {}};
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
    const nlohmann::ordered_json answer =
        AskPlumbd(control, {.kind = ControlRequest::Kind::kStatus, .action = {}, .argument = {}},
                  stop, kTimeoutMs);
    const nlohmann::ordered_json& sensor = answer.at("sensor");
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
      if (stop_.stop_requested()) throw Interrupted(say::doctor::BurnInStopped());
      progress.Update(say::doctor::BurnIn(),
                      std::min(1.0, seconds(Clock::now() - begin) / (60.0 * options_.minutes)),
                      say::doctor::Round(count_ + 1));
      const auto start = Clock::now();
      Once();
      const double took_s = seconds(Clock::now() - start);
      fastest_s_ = count_ == 1 ? took_s : std::min(fastest_s_, took_s);
      slowest_s_ = std::max(slowest_s_, took_s);
    }
  }

  void Report(DoctorReport& report) const {
    const Message work = say::doctor::Rounds(count_, fastest_s_, slowest_s_);
    Report(report, say::doctor::Processor(), scan_fault_, say::doctor::SameBits(work),
           say::doctor::ComputesWrongly());
    if (slowest_s_ > kSlowedDown * fastest_s_)
      report.Note(say::doctor::Speed(), work, say::doctor::SlowedDown());
    Report(report, say::doctor::Memory(), memory_fault_,
           say::doctor::MemoryTested(kMemoryBytes >> 20), say::doctor::ReplaceMemory());
    Report(report, say::doctor::Disk(), disk_fault_, say::doctor::DiskTested(kDiskBytes >> 20),
           say::doctor::ReplaceDisk());
    if (hottest_c_) report.Good(say::doctor::Temperature(), say::doctor::Hottest(*hottest_c_));
    ReportSensor(report);
  }

 private:
  using Clock = std::chrono::steady_clock;

  void Once() {
    ++count_;
    const Scanned scanned = ScanOnce(folder_ / "suite", stop_);
    if (count_ == 1) first_ = scanned.bytes;
    Keep(scan_fault_,
         scanned.fault.empty() ? FirstDifference(first_, scanned.bytes) : scanned.fault);
    const auto seed = static_cast<std::uint64_t>(count_);
    Keep(memory_fault_, TestMemory(kMemoryBytes, seed));
    Keep(disk_fault_, TestDisk(folder_, kDiskBytes, seed));
    if (const std::optional<double> now_c = Temperature())
      hottest_c_ = std::max(hottest_c_.value_or(*now_c), *now_c);
    if (sensor_before_ && sensor_before_->present) {
      const std::optional<SensorLook> now = CheckSensor(options_.control, stop_);
      if (!now || !now->present) Keep(sensor_fault_, say::doctor::SensorGone());
    }
  }

  void Keep(Message& kept, const Message& fault) const {
    if (kept.empty() && !fault.empty()) kept = say::doctor::InRound(count_, fault);
  }

  static void Report(DoctorReport& report, const Message& what, const Message& fault,
                     const Message& good, const Message& remedy) {
    if (fault.empty()) {
      report.Good(what, good);
    } else {
      report.Bad(what, fault, remedy);
    }
  }

  void ReportSensor(DoctorReport& report) const {
    if (!sensor_before_ || !sensor_before_->present)
      return report.Note(say::doctor::Sensor(), say::doctor::SensorNotWatched(),
                         say::doctor::WatchSensor());
    if (!sensor_fault_.empty())
      return report.Bad(say::doctor::Sensor(), sensor_fault_, say::doctor::CheckCable());
    const SensorLook now = CheckSensor(options_.control, stop_).value_or(*sensor_before_);
    report.Good(say::doctor::Sensor(), say::doctor::SensorStayed(now.pairs - sensor_before_->pairs,
                                                                 now.lost - sensor_before_->lost));
  }

  const BurnInOptions& options_;
  const std::stop_token& stop_;
  const fs::path folder_;
  const std::optional<SensorLook> sensor_before_;
  int count_ = 0;
  double fastest_s_ = 0.0, slowest_s_ = 0.0;
  std::string first_;
  Message scan_fault_, memory_fault_, disk_fault_, sensor_fault_;
  std::optional<double> hottest_c_;
};

}  // namespace

Message FirstDifference(const std::string& first, const std::string& now) {
  if (first.size() != now.size())
    return say::doctor::OtherLength(static_cast<std::int64_t>(now.size()),
                                    static_cast<std::int64_t>(first.size()));
  const auto differ = std::mismatch(first.begin(), first.end(), now.begin()).first;
  if (differ == first.end()) return {};
  return say::doctor::OtherResult(differ - first.begin());
}

Message TestMemory(std::size_t bytes, std::uint64_t seed,
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
        return say::doctor::MemoryDiffers(fmt::format("{:016x}", expected),
                                          fmt::format("{:016x}", words[i]));
    }
  }
  return {};
}

Message TestDisk(const fs::path& folder, std::size_t bytes, std::uint64_t seed,
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
  return read == written ? Message() : say::doctor::DiskDiffers(file.string());
} catch (const std::exception& error) {
  return MessageOf(error);
}

void BurnIn(const BurnInOptions& options, const CommandContext& context, DoctorReport& report) try {
  const TemporaryFolder work(options.folder, ".burn-in-");
  Progress progress(context.language);
  SimulateOptions simulate;
  simulate.out = work.path() / "suite";
  simulate.frames = options.frames;
  simulate.width = 320;
  simulate.height = 240;
  SimulateSuite(simulate, context.stop, [&](double fraction, std::string_view what) {
    progress.Update(say::cli::Simulating(), fraction, Message::Verbatim(what));
  });
  Rounds rounds(options, context.stop, work.path());
  rounds.Run(progress);
  progress.Clear();
  rounds.Report(report);
} catch (const IoError& error) {
  report.Bad(say::doctor::BurnIn(), error.message(), say::doctor::NameFolder(), kInternalError);
}

}  // namespace plumb
