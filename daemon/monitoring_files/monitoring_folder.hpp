// SPDX-License-Identifier: Apache-2.0
// Folders that `plumb monitor` writes: the numbers of every frame, and what they rest on.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "algo/monitoring/monitor.hpp"
#include "daemon/files/atomic_folder.hpp"

namespace plumb {

/// monitor.json, monitor.csv.
[[nodiscard]] OutputKind MonitoringOutput();

/// What a sensor's zero rests on.
struct SensorZero {
  bool takes_part = false;
  Pose T_since_scan = Pose::Identity();
  SensorPlace place = {};
  std::size_t frames = 0;
  double static_error = 0.0;
  std::optional<BreathingMode> breathing = {};
};

/// One session of monitoring.
struct MonitoringRecord {
  std::vector<MonitorLine> lines;
  std::vector<double> cpu_s;  ///< Of each frame after the zero.
  std::vector<Message> warnings;

  // What Describe() takes from the monitor.
  AcceptanceLimits limits;
  double zeroing_s = 0.0;
  bool has_reference = false;  ///< The numbers against it were asked for.
  std::optional<Eigen::Vector3d> reference_centroid_m;
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();
  std::optional<double> zero_time_s;  ///< Of the first frame after the zero.
  Vector6d spread_at_zero = Vector6d::Zero();
  std::vector<SensorZero> sensors;

  /// Of the first sensor that found some.
  [[nodiscard]] const BreathingMode* breathing() const;

  void Describe(const Monitor& monitor, const MonitorOptions& options);
  /// The lines without those of sensors that took no part while another one did.
  [[nodiscard]] std::vector<MonitorLine> judged() const;
  /// Whether it came to numbers.
  [[nodiscard]] bool began() const;
};

// Parts of monitor.json.
[[nodiscard]] nlohmann::ordered_json MonitoringEvents(const std::vector<MonitorLine>& lines);
[[nodiscard]] nlohmann::ordered_json MonitoringDrift(const std::vector<MonitorLine>& lines);
/// {"zero", "breathing"}
[[nodiscard]] nlohmann::ordered_json MonitoringZero(const MonitoringRecord& record);

[[nodiscard]] std::string MonitoringJson(const MonitoringRecord& record);
[[nodiscard]] std::string MonitoringCsv(const MonitoringRecord& record);

/// Writes both files, completely or not at all, and replaces an older record at that place.
/// @throws IoError
void WriteMonitoring(const MonitoringRecord& record, const std::filesystem::path& folder);

}  // namespace plumb
