// SPDX-License-Identifier: Apache-2.0
// Sends accepted results to the clinic's archive, as [dicom] results_to of the configuration says.
#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/config/dicom_settings.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/services/store_access.hpp"

namespace plumb {

/// A thread of its own, so that nothing waits for a network, and at the lowest priority. What waits
/// is what the store says: accepted results of the last 30 days that the archive has not stored.
/// So neither a restart nor a power cut loses one; one that was sent just before a cut is sent
/// twice.
class ResultArchive {
 public:
  /// The report of a scan, as PDF.
  using MakeReport =
      std::function<std::optional<std::string>(const std::string& scan_id, const Catalogue&)>;
  /// When a result that the archive did not take is tried again; the last pause repeats.
  using Pauses = std::vector<std::chrono::milliseconds>;

  /// Everything is borrowed and outlives this object.
  /// @param config_file  Read for each attempt; without one nothing is sent.
  /// @param language  Language code of the reports.
  /// @param set_warning  Called on the loop with the reason why results wait, or with an empty
  ///        message.
  ResultArchive(EventLoop& loop, std::optional<std::filesystem::path> config_file,
                std::string language, StoreAccess& store, MakeReport report,
                std::function<void(const Message& failure)> set_warning,
                Pauses pauses = {std::chrono::seconds(30), std::chrono::minutes(5),
                                 std::chrono::minutes(30)});

  /// A result was accepted. Does not wait.
  void Wake();

 private:
  void Run(const std::stop_token& stop);
  /// Sends what waits, oldest first. @return why a result still waits; empty: none does.
  Message SendAll(const std::stop_token& stop);
  void SendOne(const Scan& scan, const DicomSettings& settings);
  void ShowWarning(const Message& failure);

  EventLoop& loop_;
  const AliveFlag alive_;  // before `set_warning_`, which it ends
  const std::optional<std::filesystem::path> config_file_;
  const std::string language_;
  StoreAccess& store_;
  const MakeReport report_;
  const Pauses pauses_;
  std::function<void(const Message&)> set_warning_;
  std::mutex mutex_;
  std::condition_variable_any woken_;
  bool is_woken_ = true;  ///< Guarded by the mutex; at the start there may be earlier results.
  std::jthread thread_;   // last: it uses the members above
};

}  // namespace plumb
