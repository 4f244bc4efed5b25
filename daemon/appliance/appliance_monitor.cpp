// SPDX-License-Identifier: Apache-2.0
// Live monitoring of the body that was scanned last.
#include <chrono>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/plan_options.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

constexpr std::chrono::seconds kSecondOpens{8};

}  // namespace

Appliance::Answer Appliance::WhyNotMonitor() const {
  if (Message why = WhyNotScan(); !why.empty()) return why;
  // The body lies as it was scanned only in the session of that scan.
  const bool goes_on = last_result_ && last_result_->outcome.kind == EndedScan::Kind::kDone &&
                       last_result_->session_id == session_.id() &&
                       last_result_->patient_id == session_.patient_id() && !session_.check();
  return goes_on ? Message() : say::monitoring::NoScan();
}

MonitorJob Appliance::MakeMonitorJob() {
  MonitorJob job;
  job.info = sensors_.snapshot().info;
  job.serial = last_serial_;
  const std::string& second = parts_.config.appliance.second_sensor_serial;
  if (!second.empty()) job.second.emplace().serial = second;
  const ApplianceConfig& appliance = parts_.config.appliance;
  job.fixed = {.serials = appliance.fixed_sensors, .file = appliance.state / "fixed-sensors.json"};
  job.compare = parts_.config.compare;
  job.room = room_.OfJob();
  const std::filesystem::path scan = store_->folders.Scan(last_result_->id);
  job.scene = scan / "scene";
  if (WhyNoRecord().empty())
    job.record = {.scan = scan,
                  .head = {{"scan", last_result_->id}, {"sensor_serial", last_serial_}}};
  if (job.record && job.second) job.record->head["second_sensor_serial"] = second;
  if (last_result_->reference_id.empty()) return job;
  const std::optional<Reference> reference = store_->references.Approved(last_result_->patient_id);
  // Another one than the scan was compared with is another question.
  if (!reference || reference->id != last_result_->reference_id) return job;
  job.reference_scene = store_->folders.Scan(reference->scan_id) / "scene";
  job.check_reference = SceneCheck(reference->scan_id);
  job.compare = CompareOptionsFor(reference->plan, parts_.config.compare);
  return job;
}

/// A record must not take the room of the next scan: nothing is removed for it.
Message Appliance::WhyNoRecord() const {
  const auto space = storage_.SpaceForScans();
  try {
    if (!space || space->available >= NeededBytes() + kMostMonitoringBytes) return {};
  } catch (const std::exception& error) {
    return say::monitoring::NotRecorded(MessageOf(error));
  }
  return say::monitoring::NoRoomForRecord();
}

void Appliance::OnMonitorRecorded(const std::string& scan_id, const std::string& file) {
  if (store_ == nullptr) return;
  (void)store_thread_.Post([this, scan_id, file, &store = store_, &loop = loop_] {
    try {
      store->scans.AddFile(scan_id, file);
    } catch (const std::exception& error) {
      Log(LogLevel::kError,
          fmt::format("cannot note {} of scan {}: {}", file, scan_id, MessageOf(error).English()));
    }
    loop.Post("monitoring recorded", [this] { notices_.TellPage(web::EventKind::kData); });
  });
}

/// After each change of the state, and now and then, since other things decide, too.
void Appliance::WatchRest() {
  const bool is_between =
      state_.phase == ApplianceState::kReady || state_.phase == ApplianceState::kResult;
  rest_.Watch(is_between && WhyNotMonitor().empty()
                  ? store_->folders.Scan(last_result_->id) / "scene"
                  : std::filesystem::path());
}

/// Whose outline the camera's picture shows: that of the reference which the open session compares
/// with, and never that of another patient.
void Appliance::FollowReference() {
  followed_changes_ = notices_.data_changes();
  if (store_ == nullptr || !session_.IsOpen() || session_.purpose() != ScanPurpose::kFraction)
    return outline_.Follow({});
  try {
    const std::optional<Reference> reference = store_->references.OfSession(session_.id());
    if (!reference) return outline_.Follow({});
    OutlineJob job{.scene = store_->folders.Scan(reference->scan_id) / "scene",
                   .reference = reference->id};
    job.is_of_other_room = [state = storage_.state(), patient = session_.patient_id(),
                            scan = reference->scan_id] {
      return RoomOfImport(state, patient, scan).has_value();
    };
    job.check_reference = SceneCheck(reference->scan_id);
    if (const auto room = room_.OfJob(); room && room->why_not.empty())
      job.markers_iec = room->markers_iec;
    outline_.Follow(std::move(job));
  } catch (const std::exception& error) {
    // The next scan says what is wrong with the reference; without an outline it can still begin.
    outline_.Follow({});
    Log(LogLevel::kWarning, MessageOf(error).English());
  }
}

bool Appliance::PressMonitors() const {
  return rest_.IsAtRest() && WhyNotMonitor().empty() &&
         (state_.phase == ApplianceState::kReady || state_.phase == ApplianceState::kResult);
}

void Appliance::StartMonitor() {
  monitor_end_ = {};
  try {
    MonitorJob job = MakeMonitorJob();
    const auto feed = std::make_shared<LiveFeed>(job.queue_capacity * (job.second ? 2 : 1));
    if (job.second)
      job.second->await = [this, feed](const std::stop_token& stop) {
        return sensors_.AwaitSecond(feed, kSecondOpens, stop);
      };
    monitoring_.Begin(std::move(job), feed, *last_result_, WhyNoRecord());
    sensors_.BeginScan(feed, /*is_sweep=*/false);
  } catch (const std::exception& error) {
    loop_.Post("monitoring failed", [this, why = MessageOf(error)] { OnMonitorFailed(why); });
  }
}

void Appliance::EndMonitor() {
  monitored_ = monitoring_.End(std::exchange(monitor_end_, {}));
  sensors_.EndScan();
  session_.ArmTimer();
  // What the first of two sensors did meanwhile counts now.
  if (const auto event = std::exchange(sensor_while_two_, std::nullopt))
    loop_.Post("sensor", [this, event = *event] { NoteSensor(event); });
}

void Appliance::OnMonitorFailed(const Message& why) {
  monitor_end_ = why;
  Log(LogLevel::kError, say::monitoring::Failed(why).English());
  (void)Handle(ScanEvent::kMonitorEnded);
}

}  // namespace plumb
