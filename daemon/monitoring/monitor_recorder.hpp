// SPDX-License-Identifier: Apache-2.0
// Writes down a session of live monitoring beside its scan, off the thread that judges the frames.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/message.hpp"
#include "algo/monitoring/monitor.hpp"

namespace plumb {

/// Where a session is written down, and what its record begins with.
struct MonitorRecordPlace {
  std::filesystem::path scan;  ///< Its folder.
  nlohmann::json head;
};

/// Thread-safe. What is added is on the disk a second later: that much is lost by a power cut.
class MonitorRecorder {
 public:
  /// @param told  If recording stops before the session ends, called once with the reason, on the
  ///              recorder's thread.
  MonitorRecorder(MonitorRecordPlace place, std::function<void(const Message&)> told);
  /// Writes down what was added, and waits for that.
  ~MonitorRecorder();
  MonitorRecorder(const MonitorRecorder&) = delete;
  MonitorRecorder& operator=(const MonitorRecorder&) = delete;

  void Add(const MonitorLine& line);
  void AddEvent(nlohmann::json event);
  /// Writes down what was added and ends. @return The file, for its digest; nothing without one.
  [[nodiscard]] std::optional<std::string> End();

 private:
  struct Waiting {
    std::vector<MonitorLine> lines;
    std::vector<nlohmann::json> events;
  };
  void Run();
  void Write();

  const MonitorRecordPlace place_;
  const std::function<void(const Message&)> told_;
  std::mutex mutex_;
  std::condition_variable wake_;
  Waiting waiting_;                  ///< Guarded.
  bool ends_ = false;                ///< Guarded.
  bool writes_ = true;               ///< Guarded: nothing waits for a record that has ended.
  std::optional<std::string> file_;  ///< In the scan's folder; the thread's, until it has ended.
  std::thread thread_;               ///< Last: starts when the members above are initialised.
};

}  // namespace plumb
