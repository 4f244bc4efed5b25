#include "daemon/appliance/web_maintenance.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/appliance/diagnostics.hpp"
#include "daemon/loop/loop_report.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {

using web::ChangeResult;

void WebMaintenance::MakeBackup(const web::Actor& actor, web::Done done) {
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

void WebMaintenance::WriteDiagnostics(const web::Actor& actor, web::Done done) {
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
    constexpr std::string_view kExtension = ".txt";
    std::string name =
        (std::filesystem::temp_directory_path() / "plumb-diagnostics-XXXXXX").string();
    name += kExtension;
    const int fd = ::mkstemps(name.data(), static_cast<int>(kExtension.size()));
    if (fd < 0) throw DiskRefused(DescribeWriteError(name, errno));
    ::close(fd);
    WriteWholeFile(name, text);
    audit.Log(actor, "diagnostics.write", "", "");
    return name;
  });
}

}  // namespace plumb
