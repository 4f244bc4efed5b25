// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/monitor_session.hpp"

#include <algorithm>
#include <ctime>
#include <limits>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/units.hpp"
#include "daemon/files/compact_map.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/monitoring/common_clock.hpp"
#include "daemon/monitoring/fixed_places.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "daemon/sweep/explain.hpp"
#include "words/monitoring.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

constexpr double kTellEvery_s = 0.095;  // ten times a second, of frames at 30 Hz
constexpr double kMapEvery_s = 0.45;    // two of them a second

/// Of this thread.
double CpuSeconds() {
  timespec used{};
  (void)::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

}  // namespace

MonitorSession::MonitorSession(MonitorJob job, std::shared_ptr<LiveFeed> feed,
                               MonitorCallbacks callbacks)
    : job_(std::move(job)),
      callbacks_(std::move(callbacks)),
      feed_(std::move(feed)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

MonitorSession::~MonitorSession() { End(); }

void MonitorSession::End() {
  thread_.request_stop();
  feed_->Close();
}

void MonitorSession::Run(const std::stop_token& stop) {
  Message why;
  try {
    Watch(stop);
  } catch (const Interrupted&) {  // ended while the scenes were compared
  } catch (const std::exception& error) {
    why = Explain(error);
    callbacks_.failed(why);
  }
  EndRecord(why);
}

void MonitorSession::BeginRecord(const MonitorOptions& options) {
  const std::lock_guard lock(mutex_);
  record_.has_reference = options.judges_reference;
  if (!job_.record) return;
  MonitorRecordPlace place = *job_.record;
  place.head["started_at"] = MonitoringTime();
  place.head["judges"] = options.judges_reference ? "against_reference" : "since_zero";
  place.head["shift_tolerance_mm"] = options.limits.shift_tolerance_m / kMillimetre;
  place.head["rotation_tolerance_deg"] = options.limits.rotation_tolerance_rad / kDegree;
  recorder_ = std::make_unique<MonitorRecorder>(std::move(place), callbacks_.not_recorded);
}

void MonitorSession::EndRecord(const Message& why) {
  nlohmann::json event = {{"event", "ended"}, {"time", MonitoringTime()}};
  if (!why.empty()) {
    event["why"] = why.English();
    event["why_message"] = MessageJson(why);
  }
  AddEvent(event);
  std::unique_ptr<MonitorRecorder> recorder;
  {
    const std::lock_guard lock(mutex_);
    std::swap(recorder, recorder_);
  }
  if (!recorder) return;
  if (const std::optional<std::string> file = recorder->End()) callbacks_.recorded(*file);
}

void MonitorSession::AddEvent(const nlohmann::json& event) {
  const std::lock_guard lock(mutex_);
  if (recorder_) recorder_->AddEvent(event);
}

void MonitorSession::JudgeBreath(MonitorLine& line, MonitorUpdate& update) {
  const std::lock_guard lock(mutex_);
  update.breath = breath_.Next(line.time_s, line.breathing_m);
  update.breath_window = breath_.window();
  line.advice =
      WithBreath(line.advice, update.breath_window ? std::optional(update.breath) : std::nullopt);
}

std::optional<BreathWindow> MonitorSession::TeachBreath(double width_m) {
  const std::lock_guard lock(mutex_);
  return breath_.Teach(width_m);
}

bool MonitorSession::ForgetBreath() {
  const std::lock_guard lock(mutex_);
  const bool was_there = breath_.window().has_value();
  breath_.Forget();
  return was_there;
}

void MonitorSession::NoteZero(const Monitor& monitor, const MonitorOptions& options) {
  MonitoringRecord zero;
  zero.Describe(monitor, options);
  nlohmann::json event = MonitoringZero(zero);
  event["event"] = "zero";
  AddEvent(event);
}

void MonitorSession::CheckPlaces(const Monitor& monitor, const MonitorOptions& options) {
  std::vector<Message> found;
  for (std::size_t i = 0; i < monitor.num_sensors(); ++i) {
    const std::string& serial = i == 0 ? job_.serial : job_.second->serial;
    if (!monitor.takes_part(i) || std::ranges::count(job_.fixed.serials, serial) == 0) continue;
    if (!options.T_iec_reference) {
      found.push_back(say::monitoring::PlaceUnchecked(serial, say::monitoring::RoomUnknown()));
      continue;
    }
    const Pose T_reference_scene =
        options.accepted ? options.accepted->T_reference_current : Pose::Identity();
    const Message what = CheckFixedPlace(job_.fixed.file, serial,
                                         *options.T_iec_reference * T_reference_scene *
                                             monitor.sensor(i).place().T_camera_scene.inverse());
    if (!what.empty()) found.push_back(what);
  }
  if (found.empty()) return;
  for (const Message& what : found)
    AddEvent({{"event", "fixed_sensor"},
              {"time", MonitoringTime()},
              {"what", what.English()},
              {"what_message", MessageJson(what)}});
  callbacks_.warned(found);
}

void MonitorSession::Watch(const std::stop_token& stop) {
  const Scene scene = ReadScene(job_.scene);
  std::optional<Scene> reference;
  CompareOptions compare = job_.compare;
  compare.stop = stop;
  if (!job_.reference_scene.empty()) {
    reference = ReadApprovedScene(job_.reference_scene, job_.check_reference, stop);
  }
  std::vector<Message> warnings;
  if (reference && reference->planning) {
    // It shares no marker with the mounted sensor: the accepted scan alone is watched.
    reference.reset();
    compare.region_polygon_m.clear();
    compare.isocentre_m.reset();
    warnings.push_back(say::scan::MonitorWithoutPlan());
  }
  if (const auto room = TakeRoom(job_.room, reference ? *reference : scene, compare);
      room && !room->why_not_used.empty())
    warnings.push_back(room->why_not_used);
  const MonitorOptions options =
      MonitorOptionsOf(compare, reference ? &*reference : nullptr, scene, warnings);
  const std::vector<StreamInfo> sensors = Sensors(warnings, stop);
  Monitor monitor(scene, sensors, options);
  BeginRecord(options);
  callbacks_.begun(warnings, options.judges_reference);
  Follow(monitor, options, stop);
}

std::vector<StreamInfo> MonitorSession::Sensors(std::vector<Message>& warnings,
                                                const std::stop_token& stop) const {
  std::vector<StreamInfo> sensors = {job_.info};
  if (!job_.second) return sensors;
  if (const auto second = job_.second->await(stop))
    sensors.push_back(*second);
  else
    warnings.push_back(say::monitoring::SecondMissing(job_.second->serial));
  return sensors;
}

void MonitorSession::Follow(Monitor& monitor, const MonitorOptions& options,
                            const std::stop_token& stop) {
  (void)feed_->TakeDropped();  // those that came before
  MonitorUpdate told;
  std::optional<double> told_s;
  std::int64_t frames = 0, dropped = 0;
  bool is_zeroed = false;
  std::vector<CommonClock> clocks(monitor.num_sensors());
  const double cpu_before_s = CpuSeconds();
  double newest_s = -std::numeric_limits<double>::infinity();
  while (std::optional<Frame> frame = feed_->Next(stop)) {
    const std::size_t sensor = feed_->taken_sensor();
    if (sensor >= clocks.size()) continue;  // it came too late to be zeroed with the other one
    if (job_.second) {  // each has a clock of its own, and another one after it was unplugged
      const double stamp_s = frame->depth_time_s;
      newest_s = std::max(newest_s, clocks[sensor].SteadyStamp(stamp_s, *feed_->taken_arrived_s()));
      frame->depth_time_s = newest_s;
      frame->color_time_s += newest_s - stamp_s;
    }
    const std::optional<MonitorLine> judged = monitor.Add(*frame, sensor);
    if (!judged) continue;
    MonitorLine line = *judged;
    MonitorUpdate next;
    for (std::size_t i = 0; i < clocks.size(); ++i) next.shares.push_back(monitor.share(i));
    if (next.shares != told.shares) NoteShares(next.shares);
    JudgeBreath(line, next);
    ++frames;
    dropped += feed_->TakeDropped();
    Note(line);
    if (!is_zeroed && monitor.zero_time_s()) {
      is_zeroed = true;
      NoteZero(monitor, options);
      CheckPlaces(monitor, options);
    }
    const double now_s = SteadySeconds();
    const bool changed = line.state != told.line.state || line.advice != told.line.advice ||
                         line.reason != told.line.reason || next.shares != told.shares;
    if (told_s && !changed && now_s - *told_s < kTellEvery_s) continue;
    told_s = now_s;
    next.line = line;
    next.arrived_s = *feed_->taken_arrived_s();
    next.done_s = now_s;
    for (std::size_t i = 0; i < clocks.size(); ++i)
      next.has_breathing |= monitor.takes_part(i) && monitor.sensor(i).breathing().has_value();
    next.frames = frames;
    next.frames_dropped = dropped;
    next.cpu_ms = 1e3 * (CpuSeconds() - cpu_before_s) / static_cast<double>(frames);
    next.map = told.map;
    next.map_s = told.map_s;
    AddMap(monitor, next);
    told = next;
    callbacks_.update(told);
  }
}

void MonitorSession::AddMap(const Monitor& monitor, MonitorUpdate& update) const {
  if (update.map && update.arrived_s - update.map_s < kMapEvery_s) return;
  const std::optional<LiveMap> map = monitor.Map();
  update.map = map ? std::make_shared<const std::string>(CompactHeights(map->rise_m, map->missing))
                   : nullptr;
  update.map_s = update.arrived_s;
}

void MonitorSession::NoteShares(const std::vector<SensorShare>& shares) {
  if (shares.size() < 2) return;
  AddEvent({{"event", "sensors"},
            {"time", MonitoringTime()},
            {"shares", {Name(shares[0]), Name(shares[1])}}});
}

void MonitorSession::Note(const MonitorLine& line) {
  const std::lock_guard lock(mutex_);
  std::vector<MonitorLine>& lines = record_.lines;
  // In portions, so that not every line moves all others.
  if (lines.size() >= job_.most_lines)
    lines.erase(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(1 + lines.size() / 8));
  lines.push_back(line);
  if (recorder_) recorder_->Add(line);
  if (line.state >= MonitorState::kMonitoring) ++advice_[static_cast<std::size_t>(line.advice)];
}

std::string MonitorSession::Csv() const {
  MonitoringRecord copy;
  {
    const std::lock_guard lock(mutex_);
    copy = record_;
  }
  return MonitoringCsv(copy);
}

std::optional<std::array<double, 3>> MonitorSession::Shares() const {
  const std::lock_guard lock(mutex_);
  const auto all = static_cast<double>(advice_[0] + advice_[1] + advice_[2]);
  if (!(all > 0)) return std::nullopt;
  std::array<double, 3> shares{};
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] = static_cast<double>(advice_[i]) / all;
  return shares;
}

}  // namespace plumb
