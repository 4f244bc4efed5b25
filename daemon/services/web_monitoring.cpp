// SPDX-License-Identifier: Apache-2.0
// The page's service for live monitoring.
#include "daemon/services/web_services.hpp"

#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "algo/base/message_json.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/monitoring/live_acceptance.hpp"
#include "daemon/monitoring_files/monitoring_file.hpp"
#include "words/audit.hpp"

namespace plumb {

namespace {

using nlohmann::json;

void PutFault(auto& entry, const std::exception& error) {
  const Message why = MessageOf(error);
  entry["fault"] = why.English();
  entry["fault_message"] = MessageJson(why);
}

class WebMonitoring final : public web::MonitoringService {
 public:
  WebMonitoring(LiveMonitoring& monitoring, StoreAccess& store)
      : monitoring_(monitoring), store_(store) {}

  MonitorStatus GetMonitor() override { return monitoring_.status(); }
  std::shared_ptr<const std::string> MonitorMap() override { return monitoring_.Map(); }

  void StartMonitor(const Actor& actor, Done done) override {
    done(AnswerOf(monitoring_.Start(actor)));
  }

  void StopMonitor(const Actor& actor, Done done) override {
    done(AnswerOf(monitoring_.Stop(actor)));
  }

  void AcceptLive(const Actor& actor, const std::string& reason, Done done) override {
    const Settings settings = ReadSettings();
    const MonitorStatus now = monitoring_.status();
    if (RefuseIf(WhyNotAcceptLive(now, settings.accept_live, !reason.empty()), done)) return;
    const AcceptedLive accepted{.by = actor.user,
                                .at = MonitoringTime(),
                                .reason = reason,
                                .against_reference = *now.against_reference};
    const bool is_in = now.advice == "in";
    LogAct(actor, is_in ? "monitor.accept" : "monitor.accept_outside", now.scan_id,
           DescribeAccepted(now, reason), [this, accepted, now, done](const Change& change) {
             if (change.result == ChangeResult::kDone)
               monitoring_.NoteAccepted(accepted, now.advice);
             done(change);
           });
  }

  void TeachBreath(const Actor& actor, Done done) override {
    const Settings settings = ReadSettings();
    BreathHold taught;
    if (RefuseIf(monitoring_.TeachBreath(settings.breath_window_mm, taught), done)) return;
    LogAct(actor, "monitor.breath_teach", monitoring_.status().scan_id,
           say::audit::BreathTaught(taught.level_mm, taught.window_mm), done);
  }

  void ForgetBreath(const Actor& actor, Done done) override {
    if (RefuseIf(monitoring_.ForgetBreath(), done)) return;
    LogAct(actor, "monitor.breath_forget", monitoring_.status().scan_id, {}, done);
  }

  json MonitorRecords(const std::string& scan_id) override {
    json records = json::array();
    const std::filesystem::path folder = FolderOf(scan_id);
    for (const int number : MonitoringFilesOf(folder)) {
      json entry = {{"number", number}};
      try {
        entry["head"] = ReadMonitoringHead(FileOf(folder, number));
      } catch (const std::exception& error) {
        PutFault(entry, error);
      }
      records.push_back(std::move(entry));
    }
    return records;
  }

  nlohmann::ordered_json MonitorReport(const std::string& scan_id, int number) override {
    const std::filesystem::path folder = FolderOf(scan_id);
    if (!Has(folder, number)) return nullptr;
    try {
      return MonitoringReport(ReadMonitoringFile(FileOf(folder, number)));
    } catch (const std::exception& error) {
      nlohmann::ordered_json report = nlohmann::ordered_json::object();
      PutFault(report, error);
      return report;
    }
  }

  std::string MonitorCsv(const std::string& scan_id, int number) override {
    if (number == 0) {
      const std::shared_ptr<const MonitorSession> record = monitoring_.Record();
      return record ? record->Csv() : std::string();
    }
    const std::filesystem::path folder = FolderOf(scan_id);
    if (!Has(folder, number)) return {};
    try {
      return MonitoringCsv(ReadMonitoringFile(FileOf(folder, number)).record);
    } catch (const std::exception& error) {
      Log(LogLevel::kNotice, MessageOf(error).English());
      return {};
    }
  }

 private:
  /// @throws IoError
  Settings ReadSettings() const {
    return store_.Read(&Store::settings, [](SettingsStore& settings) { return settings.Get(); });
  }
  void LogAct(const Actor& actor, const std::string& action, const std::string& scan_id,
              const Message& detail, Done done) {
    store_.Write(&Store::audit, std::move(done),
                 [=](AuditStore& audit) { audit.Log(actor, action, scan_id, detail); });
  }
  /// Empty if there is no such scan, or its files cannot be used.
  std::filesystem::path FolderOf(const std::string& scan_id) const {
    const std::optional<Scan> scan =
        store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(scan_id); });
    return scan ? scan->folder : std::filesystem::path();
  }
  static std::filesystem::path FileOf(const std::filesystem::path& scan, int number) {
    return scan / kMonitoringFolder / MonitoringFileName(number);
  }
  static bool Has(const std::filesystem::path& scan, int number) {
    std::error_code ignored;
    return !scan.empty() && std::filesystem::exists(FileOf(scan, number), ignored);
  }

  LiveMonitoring& monitoring_;
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::MonitoringService> MakeWebMonitoring(LiveMonitoring& monitoring,
                                                          StoreAccess& store) {
  return std::make_unique<WebMonitoring>(monitoring, store);
}

}  // namespace plumb
