// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/monitor_session.hpp"

#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/sweep/explain.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

constexpr double kTellEvery_s = 0.095;  // ten times a second, of frames at 30 Hz

}  // namespace

MonitorSession::MonitorSession(MonitorJob job, MonitorCallbacks callbacks)
    : job_(std::move(job)),
      callbacks_(std::move(callbacks)),
      feed_(std::make_shared<LiveFeed>(job_.queue_capacity)),
      thread_([this](const std::stop_token& stop) { Run(stop); }) {}

MonitorSession::~MonitorSession() { End(); }

void MonitorSession::End() {
  thread_.request_stop();
  feed_->Close();
}

void MonitorSession::Run(const std::stop_token& stop) {
  try {
    Watch(stop);
  } catch (const Interrupted&) {  // ended while the scenes were compared
  } catch (const std::exception& error) {
    callbacks_.failed(Explain(error));
  }
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
  Monitor monitor(scene, job_.info, options);
  {
    const std::lock_guard lock(mutex_);
    record_.has_reference = options.judges_reference;
  }
  callbacks_.begun(warnings, options.judges_reference);
  (void)feed_->TakeDropped();  // those that came before
  MonitorUpdate told;
  std::optional<double> told_s;
  std::int64_t frames = 0, dropped = 0;
  while (const std::optional<Frame> frame = feed_->Next(stop)) {
    const MonitorLine line = monitor.Add(*frame).value();
    ++frames;
    dropped += feed_->TakeDropped();
    Note(line);
    const double now_s = SteadySeconds();
    const bool changed = line.state != told.line.state || line.advice != told.line.advice ||
                         line.reason != told.line.reason;
    if (told_s && !changed && now_s - *told_s < kTellEvery_s) continue;
    told_s = now_s;
    told = {.line = line,
            .arrived_s = feed_->taken_arrived_s(),
            .done_s = now_s,
            .has_breathing = monitor.sensor().breathing().has_value(),
            .frames = frames,
            .frames_dropped = dropped};
    callbacks_.update(told);
  }
}

void MonitorSession::Note(const MonitorLine& line) {
  const std::lock_guard lock(mutex_);
  std::vector<MonitorLine>& lines = record_.lines;
  // In portions, so that not every line moves all others.
  if (lines.size() >= job_.most_lines)
    lines.erase(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(1 + lines.size() / 8));
  lines.push_back(line);
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
