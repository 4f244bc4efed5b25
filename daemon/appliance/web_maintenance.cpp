// The page's service for backups and diagnostics.
#include "daemon/appliance/web_services.hpp"

#include <unistd.h>

#include <filesystem>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/appliance/diagnostics.hpp"
#include "daemon/loop/loop_report.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"

namespace plumb {

using web::ChangeResult;

namespace {

class WebMaintenance final : public web::MaintenanceService {
 public:
  WebMaintenance(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}
  ~WebMaintenance() override { *alive_ = false; }

  void MakeBackup(const web::Actor& actor, web::Done done) override {
    const std::filesystem::path folder = appliance_.BackupTarget();
    if (folder.empty())
      return done(Refusal(ChangeResult::kInvalid,
                          "no folder for backups is configured: set backup_folder in [storage]"));
    appliance_.BackUp(
        actor, folder, [done, alive = alive_](const std::string& error, const BackupReport&) {
          if (!*alive) return;
          done(Refusal(error.empty() ? ChangeResult::kDone : ChangeResult::kFailed, error));
        });
  }

  void WriteDiagnostics(const web::Actor& actor, web::Done done) override {
    const nlohmann::json status = appliance_.StatusJson();
    const std::string loop = LoopTable(appliance_.loop().meter());
    const web::Health health = appliance_.Health();
    const auto report = [done = std::move(done)](const web::Change& change) {
      web::Change answer = change;
      answer.file = std::exchange(answer.id, {});
      done(answer);
    };
    store_.Change(&Store::audit, report, [=](AuditStore& audit) {
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
        throw DiskRefused(error.what());
      }
      audit.Log(actor, "diagnostics.write", "", "");
      return name;
    });
  }

 private:
  Appliance& appliance_;
  StoreAccess& store_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
};

}  // namespace

std::unique_ptr<web::MaintenanceService> MakeWebMaintenance(Appliance& appliance,
                                                            StoreAccess& store) {
  return std::make_unique<WebMaintenance>(appliance, store);
}

}  // namespace plumb
