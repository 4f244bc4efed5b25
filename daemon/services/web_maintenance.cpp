// SPDX-License-Identifier: Apache-2.0
// The page's service for backups and diagnostics.
#include "daemon/services/web_services.hpp"

#include <unistd.h>

#include <filesystem>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/loop/loop_report.hpp"
#include "daemon/unit/diagnostics.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "words/messages.hpp"
#include "words/upkeep.hpp"

namespace plumb {

namespace {

class WebMaintenance final : public web::MaintenanceService {
 public:
  WebMaintenance(Appliance& appliance, StorageUpkeep& upkeep, MessagesOut& messages,
                 const LoopMeter& meter, StoreAccess& store)
      : appliance_(appliance), upkeep_(upkeep), messages_(messages), meter_(meter), store_(store) {}

  void MakeBackup(const Actor& actor, Done done) override {
    const std::filesystem::path folder = upkeep_.BackupTarget();
    if (folder.empty()) return done(Refused(ChangeResult::kInvalid, say::upkeep::NoBackupFolder()));
    upkeep_.BackUp(
        actor, folder, alive_.WhileAlive([done](const Message& error, const BackupReport&) {
          done(Refused(error.empty() ? ChangeResult::kDone : ChangeResult::kFailed, error));
        }));
  }

  void NoteBackupVerified(const Actor& actor, Done done) override {
    store_.Write(&Store::audit, alive_.WhileAlive([this, done](const Change& change) {
      if (change.result == ChangeResult::kDone) upkeep_.BackupVerified();
      done(change);
    }),
                 [=](AuditStore& audit) { audit.Log(actor, "backup.verify", "", Message()); });
  }

  void WriteDiagnostics(const Actor& actor, Done done) override {
    const nlohmann::json status = appliance_.StatusJson();
    const std::string loop = LoopTable(meter_);
    const Health health = appliance_.health();
    const auto report = [done = std::move(done)](const Change& change) {
      Change answer = change;
      answer.file = std::exchange(answer.id, {});
      done(answer);
    };
    store_.Write(&Store::audit, report, [=](AuditStore& audit) {
      const std::string text =
          DiagnosticsText(status, health, loop, audit.Find({0, 500, "", /*views=*/false}));
      std::string name;
      try {
        const UniqueFile file =
            MakeUniqueFile(std::filesystem::temp_directory_path(), "plumb-diagnostics-", ".txt");
        ::close(file.descriptor);
        name = file.path.string();
        WriteWholeFile(name, text);
      } catch (const IoError& error) {
        throw DiskRefused(error.message());
      }
      audit.Log(actor, "diagnostics.write", "", Message());
      return name;
    });
  }

  void SendTestMessage(const Actor& actor, Done done) override {
    if (!messages_.IsSetUp()) return done(Refused(ChangeResult::kInvalid, say::messages::NoWay()));
    const auto send = alive_.WhileAlive([this, done](const Change& logged) {
      if (logged.result != ChangeResult::kDone) return done(logged);
      messages_.Test([done](const Message& failure) {
        done(Refused(failure.empty() ? ChangeResult::kDone : ChangeResult::kFailed, failure));
      });
    });
    store_.Write(&Store::audit, send,
                 [=](AuditStore& audit) { audit.Log(actor, "messages.test", "", Message()); });
  }

 private:
  Appliance& appliance_;
  StorageUpkeep& upkeep_;
  MessagesOut& messages_;
  const LoopMeter& meter_;
  StoreAccess& store_;
  AliveFlag alive_;
};

}  // namespace

std::unique_ptr<web::MaintenanceService> MakeWebMaintenance(Appliance& appliance,
                                                            StorageUpkeep& upkeep,
                                                            MessagesOut& messages,
                                                            const LoopMeter& meter,
                                                            StoreAccess& store) {
  return std::make_unique<WebMaintenance>(appliance, upkeep, messages, meter, store);
}

}  // namespace plumb
