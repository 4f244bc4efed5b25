// SPDX-License-Identifier: Apache-2.0
// Live monitoring of one body, from the sensor's mounting on: its thread and its record.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/monitoring/breath_gate.hpp"
#include "algo/monitoring/monitor.hpp"
#include "daemon/monitoring/monitor_recorder.hpp"
#include "daemon/monitoring_files/monitoring_folder.hpp"
#include "daemon/pipeline/live_feed.hpp"
#include "daemon/scanning/scan_session.hpp"

namespace plumb {

/// A second sensor at rest beside the first one.
struct SecondOfMonitoring {
  std::string serial;
  /// Waits until it is open; nothing if it is not in time. Called on the session's thread.
  std::function<std::optional<StreamInfo>(const std::stop_token&)> await;
};

/// Units that are fixed in the room for good, as CheckFixedPlace() has it.
struct FixedSensors {
  std::vector<std::string> serials = {};
  std::filesystem::path file = {};
};

struct MonitorJob {
  StreamInfo info;  ///< From the sensor.
  std::string serial = {};
  std::optional<SecondOfMonitoring> second = {};  ///< Its frames are the feed's, of sensor 1.
  FixedSensors fixed = {};
  CompareOptions compare;
  std::optional<RoomAxes> room;           ///< As ScanJob has it.
  std::filesystem::path scene;            ///< Of the body as it lies.
  std::filesystem::path reference_scene;  ///< Empty: there is none to judge against.
  /// As ScanJob has it.
  std::function<Message(const std::stop_token&)> check_reference;
  std::optional<MonitorRecordPlace> record = {};  ///< Nothing: it is kept in memory only.
  /// Frames of each sensor that may wait: an old number is of no use.
  std::size_t queue_capacity = 4;
  std::size_t most_lines = 108'000;  ///< Of the record: an hour at 30 Hz; the oldest go.
};

/// One judged frame.
struct MonitorUpdate {
  MonitorLine line;
  double arrived_s = 0.0;  ///< Steady time.
  double done_s = 0.0;
  bool has_breathing = false;
  std::optional<BreathWindow> breath_window = {};
  LiveAdvice breath = LiveAdvice::kUnknown;  ///< With a window; the line's advice holds it.
  std::int64_t frames = 0, frames_dropped = 0;
  std::vector<SensorShare> shares = {};         ///< Of each sensor.
  double cpu_ms = 0.0;                          ///< Of the thread for each frame, in the mean.
  std::shared_ptr<const std::string> map = {};  ///< As CompactHeights() has it; may be null.
  double map_s = 0.0;                           ///< Steady time at which its images arrived.
};

/// Called on the thread; they post to the loop.
struct MonitorCallbacks {
  /// Once scene and reference are read.
  std::function<void(const std::vector<Message>& warnings, bool judges_reference)> begun;
  /// Ten times a second, and at once where state or advice change.
  /// More of them, once it is zeroed.
  std::function<void(const std::vector<Message>& warnings)> warned;
  std::function<void(const MonitorUpdate&)> update;
  std::function<void(const Message& why)> failed;
  /// The record on the disk ends although the session goes on.
  std::function<void(const Message& why)> not_recorded;
  /// It is complete. @param file  In the scan's folder.
  std::function<void(const std::string& file)> recorded;
};

/// All functions but the constructor are thread-safe.
class MonitorSession {
 public:
  /// @param feed  Of the sensors' frames.
  MonitorSession(MonitorJob job, std::shared_ptr<LiveFeed> feed, MonitorCallbacks callbacks);
  ~MonitorSession();
  MonitorSession(const MonitorSession&) = delete;
  MonitorSession& operator=(const MonitorSession&) = delete;

  /// Ends the thread soon; the destructor waits for that.
  void End();
  /// As BreathGate has it; the next frame is judged by it.
  [[nodiscard]] std::optional<BreathWindow> TeachBreath(double width_m);
  /// False: there was none.
  [[nodiscard]] bool ForgetBreath();
  /// For the record on the disk.
  void AddEvent(const nlohmann::json& event);
  /// What was said so far, as monitor.csv has it.
  [[nodiscard]] std::string Csv() const;
  /// Shares of in, out and unknown, 0 to 1, since the first numbers; nothing without any.
  [[nodiscard]] std::optional<std::array<double, 3>> Shares() const;

 private:
  void Run(const std::stop_token& stop);
  void BeginRecord(const MonitorOptions& options);
  void EndRecord(const Message& why);
  void Watch(const std::stop_token& stop);
  void Follow(Monitor& monitor, const MonitorOptions& options, const std::stop_token& stop);
  [[nodiscard]] std::vector<StreamInfo> Sensors(std::vector<Message>& warnings,
                                                const std::stop_token& stop) const;
  void AddMap(const Monitor& monitor, MonitorUpdate& update) const;
  void Note(const MonitorLine& line);
  void NoteShares(const std::vector<SensorShare>& shares);
  void JudgeBreath(MonitorLine& line, MonitorUpdate& update);
  void NoteZero(const Monitor& monitor, const MonitorOptions& options);
  void CheckPlaces(const Monitor& monitor, const MonitorOptions& options);

  const MonitorJob job_;
  const MonitorCallbacks callbacks_;
  const std::shared_ptr<LiveFeed> feed_;
  mutable std::mutex mutex_;
  MonitoringRecord record_;                    ///< Guarded.
  BreathGate breath_;                          ///< Guarded.
  std::array<std::int64_t, 3> advice_{};       ///< Guarded: frames of each since the first numbers.
  std::unique_ptr<MonitorRecorder> recorder_;  ///< Guarded: the pointer.
  std::jthread thread_;  ///< Last: starts when the members above are initialised.
};

}  // namespace plumb
