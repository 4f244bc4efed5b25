// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/monitor_recorder.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

constexpr std::chrono::seconds kWriteEvery{1};

/// The first number that no record of the scan has. @throws IoError
int FreeNumber(const std::filesystem::path& scan) {
  const std::vector<int> taken = MonitoringFilesOf(scan);
  for (int number = 1; number <= kMostMonitoringFiles; ++number)
    if (!std::ranges::binary_search(taken, number)) return number;
  throw IoError(say::monitoring::TooManyRecords(kMostMonitoringFiles));
}

}  // namespace

MonitorRecorder::MonitorRecorder(MonitorRecordPlace place, std::function<void(const Message&)> told)
    : place_(std::move(place)), told_(std::move(told)), thread_([this] { Run(); }) {}

MonitorRecorder::~MonitorRecorder() { (void)End(); }

void MonitorRecorder::Add(const MonitorLine& line) {
  const std::lock_guard lock(mutex_);
  if (writes_) waiting_.lines.push_back(line);
}

void MonitorRecorder::AddEvent(nlohmann::json event) {
  const std::lock_guard lock(mutex_);
  if (writes_) waiting_.events.push_back(std::move(event));
}

std::optional<std::string> MonitorRecorder::End() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
  return file_;
}

void MonitorRecorder::Run() {
  try {
    Write();
  } catch (const std::exception& error) {
    told_(say::monitoring::NotRecorded(MessageOf(error)));
  }
  const std::lock_guard lock(mutex_);
  writes_ = false;
  waiting_ = {};
}

void MonitorRecorder::Write() {
  const std::string name = MonitoringFileName(FreeNumber(place_.scan));
  MonitoringFileWriter file(place_.scan / kMonitoringFolder / name, place_.head);
  file_ = std::string(kMonitoringFolder) + '/' + name;
  for (bool ends = false; !ends;) {
    Waiting now;
    {
      std::unique_lock lock(mutex_);
      (void)wake_.wait_for(lock, kWriteEvery, [this] { return ends_; });
      std::swap(now, waiting_);
      ends = ends_;
    }
    if (now.lines.empty() && now.events.empty()) continue;
    if (!file.HasRoom()) throw IoError(say::monitoring::RecordFull());
    file.AddFrames(now.lines);
    for (const nlohmann::json& event : now.events) file.AddEvent(event);
    file.Sync();
  }
}

}  // namespace plumb
