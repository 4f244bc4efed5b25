// An appliance whose database fails under it.
#include <algorithm>
#include <chrono>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/web_settings.hpp"
#include "daemon/records/file_cipher.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// What an appliance with an empty state folder runs in.
struct Surroundings {
  const testing::TempFolder folder;
  testing::FakeBus bus;
  EventLoop loop;
  Config config;

  Surroundings() { config.appliance.state = folder / "state"; }
};

TEST(ApplianceStorage, ADatabaseThatCannotBeReadAnyMoreIsSafeModeAndNotTheEnd) {
  Surroundings around;
  {
    Store store(
        around.config.appliance.state);  // and closed again: nothing of it is in anybody's memory
    (void)store.patients.Add({.user = "anna", .address = {}}, "A", "");
  }
  Appliance appliance(
      around.loop,
      {.config = around.config,
       .configuration_fault = {},
       .make_provider = [&] { return std::make_unique<testing::FakeProvider>(around.bus); },
       .before_scan = {},
       .button = nullptr,
       .indicator = nullptr,
       .demo_patient = {}});
  for (const fs::directory_entry& entry : fs::directory_iterator(around.config.appliance.state)) {
    if (!entry.is_regular_file()) continue;
    std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);  // behind the header
    file << std::string(fs::file_size(entry.path()), 'x');
  }
  EXPECT_EQ(appliance.WebStatus().state, web::ApplianceState::kNoSensor);
  EventLoop::Source timer = around.loop.MakeTimer("end", [&] { around.loop.Quit(0); });
  timer.ArmAfter(std::chrono::milliseconds(50));
  EXPECT_EQ(around.loop.Run(), 0);
  EXPECT_THAT(appliance.storage_fault(), HasSubstr("damaged"));
  EXPECT_FALSE(appliance.WebStatus().fault.empty());
  EXPECT_FALSE(appliance.Health().ok);
}

/// Until `done`, or for a minute: a backup gives way to all else that the machine does.
template <typename Done>
bool RunUntil(EventLoop& loop, const Done& done) {
  bool is_done = false;
  EventLoop::Source end = loop.MakeTimer("end", [&] { loop.Quit(0); });
  end.ArmAfter(std::chrono::seconds(60));
  EventLoop::Source look = loop.MakeTimer("look", [&] {
    is_done = done();
    if (is_done) return loop.Quit(0);
    look.ArmAfter(std::chrono::milliseconds(20));
  });
  look.ArmAfter(std::chrono::milliseconds(1));
  (void)loop.Run();
  return is_done;
}

ApplianceParts PartsOf(const Config& config, testing::FakeBus& bus) {
  return {.config = config,
          .configuration_fault = {},
          .make_provider = [&bus] { return std::make_unique<testing::FakeProvider>(bus); },
          .before_scan = {},
          .button = nullptr,
          .indicator = nullptr,
          .demo_patient = {}};
}

/// The appliance itself verifies the chain of digests, and reports what it finds.
TEST(ApplianceStorage, AnAuditLogThatWasChangedFromOutsideIsReported) {
  for (const char* change : {"", "UPDATE audit SET user = 'bert' WHERE number = 2",
                             "DELETE FROM audit WHERE number = (SELECT max(number) FROM audit)"}) {
    SCOPED_TRACE(change);
    Surroundings around;
    {
      Store store(around.config.appliance.state);
      for (int i = 0; i < 3; ++i)
        store.audit.Log({.user = "anna", .address = {}}, "note", "", std::to_string(i));
    }
    {
      Database direct(around.config.appliance.state / "plumb.db", Database::Access::kReadWrite);
      direct.Execute(std::string("DROP TRIGGER IF EXISTS audit_no_update; DROP TRIGGER IF EXISTS "
                                 "audit_no_delete; ") +
                     change);
    }
    Appliance appliance(around.loop, PartsOf(around.config, around.bus));
    const auto is_told = [&] {
      const std::vector<std::string> warnings = appliance.WebStatus().storage.warnings;
      return std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
        return warning.starts_with("The audit log has been changed");
      });
    };
    if (*change != '\0') {
      EXPECT_TRUE(RunUntil(around.loop, is_told));
      continue;
    }
    EventLoop::Source end = around.loop.MakeTimer("end", [&] { around.loop.Quit(0); });
    end.ArmAfter(std::chrono::milliseconds(300));
    (void)around.loop.Run();
    EXPECT_FALSE(is_told());
  }
}

/// A database with more rows than are checked before the first look at the time; `is_damaged`: the
/// last row is not what its index says. No query of the store meets it.
void MakeLargeDatabase(const fs::path& state, bool is_damaged) {
  { const Store store(state); }
  {
    Database direct(state / "plumb.db", Database::Access::kReadWrite);
    direct.Execute("CREATE TABLE large (x); CREATE INDEX large_x ON large (x)");
    direct.Execute(
        "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 20000) "
        "INSERT INTO large SELECT 'row ' || i FROM n");
  }
  if (!is_damaged) return;
  std::string bytes = ReadTextFile(state / "plumb.db", 1U << 26U);
  const std::size_t last = bytes.find("row 20000");
  ASSERT_NE(last, std::string::npos);
  bytes[last] = 'R';
  std::ofstream(state / "plumb.db", std::ios::binary) << bytes;
}

TEST(ApplianceStorage, ADatabaseTooLargeForTheCheckAtTheStartIsCheckedWhileItWorks) {
  for (const bool is_damaged : {false, true}) {
    SCOPED_TRACE(is_damaged);
    Surroundings around;
    MakeLargeDatabase(around.config.appliance.state, is_damaged);
    ApplianceParts parts = PartsOf(around.config, around.bus);
    parts.check_limit = std::chrono::milliseconds(-1);
    Appliance appliance(around.loop, std::move(parts));
    EXPECT_EQ(appliance.storage_fault(), "") << "the start did not wait for the check";
    const auto is_found = [&] { return !appliance.storage_fault().empty(); };
    if (is_damaged) {
      EXPECT_TRUE(RunUntil(around.loop, is_found));
      EXPECT_THAT(appliance.storage_fault(), HasSubstr("is damaged"));
      EXPECT_FALSE(appliance.Health().ok);
      continue;
    }
    EventLoop::Source end = around.loop.MakeTimer("end", [&] { around.loop.Quit(0); });
    end.ArmAfter(std::chrono::milliseconds(1500));
    (void)around.loop.Run();
    EXPECT_FALSE(is_found());
  }
}

/// With time for the check, the same damage is found before anything begins.
TEST(ApplianceStorage, ADamagedDatabaseIsFoundAtTheStart) {
  Surroundings around;
  MakeLargeDatabase(around.config.appliance.state, true);
  const Appliance appliance(around.loop, PartsOf(around.config, around.bus));
  EXPECT_THAT(appliance.storage_fault(), HasSubstr("is damaged"));
}

TEST(ApplianceStorage, SettingsThatCannotBeReadAreNoDefaults) {
  Surroundings around;
  {
    Store store(around.config.appliance.state);
    web::Settings settings;
    settings.idle_logout_min = 7;
    store.settings.Change({.user = "anna", .address = {}}, settings);
  }
  const auto set = [&](const std::string& text) {
    Database(around.config.appliance.state / "plumb.db", Database::Access::kReadWrite)
        .Execute("UPDATE settings SET value = '" + text + "' WHERE name = 'settings'");
  };
  {
    Appliance appliance(around.loop, PartsOf(around.config, around.bus));
    StoreAccess access(appliance);
    EXPECT_EQ(WebSettings(access).GetSettings().idle_logout_min, 7);
  }
  set("{");
  Appliance appliance(around.loop, PartsOf(around.config, around.bus));
  StoreAccess access(appliance);
  EXPECT_THAT(testing::MessageOf<IoError>([&] { (void)WebSettings(access).GetSettings(); }),
              HasSubstr("what is stored cannot be read: the stored settings cannot be read: "))
      << "the page goes by this sentence";
  // A complete set replaces them.
  web::Settings entered;
  entered.idle_logout_min = 9;
  std::optional<web::Change> changed;
  WebSettings settings(access);
  settings.ChangeSettings({.user = "anna", .address = {}}, entered,
                          [&](const web::Change& change) { changed = change; });
  EXPECT_TRUE(RunUntil(around.loop, [&] { return changed.has_value(); }));
  EXPECT_EQ(changed->result, web::ChangeResult::kDone);
  EXPECT_EQ(settings.GetSettings().idle_logout_min, 9);
}

TEST(ApplianceStorage, ABackupIsMadeOffTheLoopAndRefusedInSafeMode) {
  Surroundings around;
  {
    Appliance appliance(around.loop, PartsOf(around.config, around.bus));
    EXPECT_TRUE(appliance.BackupTarget().empty());
    std::optional<std::string> made, refused;
    appliance.BackUp({.user = "anna", .address = {}}, around.folder / "backup",
                     [&](const std::string& error, const BackupReport& report) {
                       made = error;
                       EXPECT_EQ(report.files, 1U);
                     });
    appliance.BackUp({.user = "anna", .address = {}}, "/proc/backup",
                     [&](const std::string& error, const BackupReport&) { refused = error; });
    EXPECT_FALSE(made || refused) << "the loop does not wait";
    EXPECT_TRUE(RunUntil(around.loop, [&] { return made && refused; }));
    EXPECT_EQ(made, "");
    EXPECT_THAT(refused.value_or(""), HasSubstr("/proc"));
  }
  EXPECT_EQ(RestoreBackup(around.folder / "backup", around.folder / "restored").files, 1U);
  // With a key in the configuration every backup is encrypted, the clock's and the page's too.
  std::ofstream(around.folder / "key") << "a passphrase of some length\n";
  fs::permissions(around.folder / "key", fs::perms::owner_read | fs::perms::owner_write);
  {
    ApplianceConfig& appliance_config = around.config.appliance;
    appliance_config.backup_key_file = around.folder / "key";
    EventLoop another;
    Appliance appliance(another, PartsOf(around.config, around.bus));
    std::optional<std::string> made, refused;
    appliance.BackUp({.user = "anna", .address = {}}, around.folder / "sealed",
                     [&](const std::string& error, const BackupReport&) { made = error; });
    appliance.BackUp(
        {.user = "anna", .address = {}}, around.folder / "none",
        [&](const std::string& error, const BackupReport&) { refused = error; },
        around.folder / "no-such-key");
    EXPECT_TRUE(RunUntil(another, [&] { return made && refused; }));
    EXPECT_EQ(made, "");
    EXPECT_THAT(refused.value_or(""), HasSubstr("no-such-key"));
    EXPECT_FALSE(fs::exists(around.folder / "none"));
  }
  EXPECT_THROW((void)RestoreBackup(around.folder / "sealed", around.folder / "opened"), DataError);
  const BackupSecret secret(around.folder / "key");
  EXPECT_EQ(RestoreBackup(around.folder / "sealed", around.folder / "opened", {}, &secret).files,
            1U);
  {
    std::ofstream(around.config.appliance.state / "plumb.db") << std::string(20000, 'x');
    EventLoop another;
    Appliance appliance(another, PartsOf(around.config, around.bus));
    std::string answer;
    appliance.BackUp({.user = "anna", .address = {}}, around.folder / "other",
                     [&](const std::string& error, const BackupReport&) { answer = error; });
    EXPECT_THAT(answer, HasSubstr("safe mode"));
  }
}

/// A backup on the disk of the scans is lost with it. Memory is never the disk of the temporary
/// files unless it is asked for.
TEST(ApplianceStorage, ABackupBesideTheScansIsWarnedOf) {
  for (const bool is_beside : {true, false}) {
    SCOPED_TRACE(is_beside);
    Surroundings around;
    const fs::path memory = "/dev/shm" / around.folder.path().filename();
    const fs::path folder = is_beside ? around.folder / "backup" : memory;
    around.config.appliance.backup_folder = folder;
    Appliance appliance(around.loop, PartsOf(around.config, around.bus));
    std::optional<std::string> made;
    appliance.BackUp({.user = "anna", .address = {}}, appliance.BackupTarget(),
                     [&](const std::string& error, const BackupReport&) { made = error; });
    EXPECT_TRUE(RunUntil(around.loop, [&] { return made.has_value(); }));
    EXPECT_EQ(made, "");
    const std::vector<std::string> warnings = appliance.WebStatus().storage.warnings;
    EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(),
                            [](const std::string& warning) {
                              return warning.find("lies on the disk of the scans") !=
                                     std::string::npos;
                            }),
              is_beside ? 1 : 0);
    fs::remove_all(memory);
  }
}

}  // namespace
}  // namespace plumb
