// An appliance whose database fails under it.
#include <algorithm>
#include <chrono>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/appliance/unit_recovery.hpp"
#include "daemon/appliance/web_services.hpp"
#include "daemon/records/file_cipher.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"

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

void RunFor(EventLoop& loop, std::chrono::milliseconds time) {
  EventLoop::Source end = loop.MakeTimer("end", [&] { loop.Quit(0); });
  end.ArmAfter(time);
  EXPECT_EQ(loop.Run(), 0);
}

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
       .make_provider = [&] { return std::make_unique<testing::FakeProvider>(around.bus); },
       .before_scan = {},
       .button = nullptr,
       .indicator = nullptr,
       .demo_patient = {},
       .storage = {.retries = {std::chrono::milliseconds(1)}}});
  for (const fs::directory_entry& entry : fs::directory_iterator(around.config.appliance.state)) {
    if (!entry.is_regular_file()) continue;
    std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);  // behind the header
    file << std::string(fs::file_size(entry.path()), 'x');
  }
  EXPECT_EQ(appliance.WebStatus().state, ApplianceState::kNoSensor);
  RunFor(around.loop, std::chrono::milliseconds(300));
  EXPECT_THAT(appliance.storage_fault(), HasSubstr("damaged")) << "and it is not tried again";
  EXPECT_FALSE(appliance.WebStatus().fault.empty());
  EXPECT_FALSE(appliance.health().ok);
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
          .make_provider = [&bus] { return std::make_unique<testing::FakeProvider>(bus); },
          .before_scan = {},
          .button = nullptr,
          .indicator = nullptr,
          .demo_patient = {}};
}

TEST(ApplianceStorage, AFaultThatQuotesAPathInAnyEncodingIsUtf8) {
  Surroundings around;
  ApplianceParts parts = PartsOf(around.config, around.bus);
  parts.storage.configuration_fault = "cannot read /media/\xff.toml";
  Appliance appliance(around.loop, parts);
  EXPECT_EQ(appliance.storage_fault(), "cannot read /media/\xEF\xBF\xBD.toml");
}

TEST(ApplianceStorage, AListenerThatFailsIsReportedAndDoesNotEndTheLoop) {
  Surroundings around;
  Appliance appliance(around.loop, PartsOf(around.config, around.bus));
  int lines = 0, notices = 0;
  appliance.SetEventListener([&](const std::string&) {
    ++lines;
    throw std::runtime_error("the socket is gone");
  });
  appliance.SetWebListener([&](web::EventKind) {
    ++notices;
    throw std::bad_alloc();
  });
  around.loop.Post("test", [&] {
    appliance.SetRolledBack("the update was rolled back");
    (void)appliance.Press(ButtonPress::kShort,
                          {.user = "tester", .address = ""});  // ignored without a sensor
  });
  EXPECT_TRUE(RunUntil(around.loop, [&] { return lines > 0 && notices > 0; }));
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
    RunFor(around.loop, std::chrono::milliseconds(300));
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
    parts.storage.check_limit = std::chrono::milliseconds(-1);
    Appliance appliance(around.loop, std::move(parts));
    EXPECT_EQ(appliance.storage_fault(), "") << "the start did not wait for the check";
    const auto is_found = [&] { return !appliance.storage_fault().empty(); };
    if (is_damaged) {
      EXPECT_TRUE(RunUntil(around.loop, is_found));
      EXPECT_THAT(appliance.storage_fault(), HasSubstr("is damaged"));
      EXPECT_FALSE(appliance.health().ok);
      continue;
    }
    RunFor(around.loop, std::chrono::milliseconds(1500));
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
    Settings settings;
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
    EXPECT_EQ(MakeWebSettings(access)->GetSettings().idle_logout_min, 7);
  }
  set("{");
  EventLoop another;
  Appliance appliance(another, PartsOf(around.config, around.bus));
  StoreAccess access(appliance);
  EXPECT_THAT(testing::MessageOf<IoError>([&] { (void)MakeWebSettings(access)->GetSettings(); }),
              HasSubstr("what is stored cannot be read: the stored settings cannot be read: "))
      << "the page goes by this sentence";
  // A complete set replaces them.
  Settings entered;
  entered.idle_logout_min = 9;
  std::optional<Change> changed;
  const auto settings = MakeWebSettings(access);
  settings->ChangeSettings({.user = "anna", .address = {}}, entered,
                           [&](const Change& change) { changed = change; });
  EXPECT_TRUE(RunUntil(another, [&] { return changed.has_value(); }));
  EXPECT_EQ(changed->result, ChangeResult::kDone);
  EXPECT_EQ(settings->GetSettings().idle_logout_min, 9);
}

TEST(ApplianceStorage, ABackupIsMadeOffTheLoopAndRefusedInSafeMode) {
  Surroundings around;
  {
    Appliance appliance(around.loop, PartsOf(around.config, around.bus));
    EXPECT_TRUE(appliance.upkeep().BackupTarget().empty());
    std::optional<std::string> made, refused;
    appliance.upkeep().BackUp({.user = "anna", .address = {}}, around.folder / "backup",
                              [&](const std::string& error, const BackupReport& report) {
                                made = error;
                                EXPECT_EQ(report.files, 1U);
                              });
    appliance.upkeep().BackUp(
        {.user = "anna", .address = {}}, "/proc/backup",
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
    appliance.upkeep().BackUp({.user = "anna", .address = {}}, around.folder / "sealed",
                              [&](const std::string& error, const BackupReport&) { made = error; });
    appliance.upkeep().BackUp(
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
    appliance.upkeep().BackUp(
        {.user = "anna", .address = {}}, around.folder / "other",
        [&](const std::string& error, const BackupReport&) { answer = error; });
    EXPECT_THAT(answer, HasSubstr("safe mode"));
  }
}

/// Another disk is made of memory, which a backup may be taken from and is not made into.
fs::path InMemory(const Surroundings& around) {
  return "/dev/shm" / around.folder.path().filename();
}

/// A backup on the disk of the scans is lost with it.
TEST(ApplianceStorage, ABackupBesideTheScansIsWarnedOf) {
  for (const bool is_beside : {true, false}) {
    SCOPED_TRACE(is_beside);
    Surroundings around;
    const fs::path memory = InMemory(around);
    if (!is_beside) around.config.appliance.state = memory / "state";
    around.config.appliance.backup_folder = around.folder / "backup";
    {
      Appliance appliance(around.loop, PartsOf(around.config, around.bus));
      std::optional<std::string> made;
      appliance.upkeep().BackUp(
          {.user = "anna", .address = {}}, appliance.upkeep().BackupTarget(),
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
    }
    fs::remove_all(memory);
  }
}

TEST(ApplianceStorage, ABackupInMemoryIsRefused) {
  Surroundings around;
  const fs::path memory = InMemory(around);
  Appliance appliance(around.loop, PartsOf(around.config, around.bus));
  std::optional<std::string> refused;
  appliance.upkeep().BackUp(
      {.user = "anna", .address = {}}, memory,
      [&](const std::string& error, const BackupReport&) { refused = error; });
  EXPECT_TRUE(RunUntil(around.loop, [&] { return refused.has_value(); }));
  EXPECT_THAT(refused.value_or(""), HasSubstr("is empty after a restart of the machine"));
  EXPECT_FALSE(fs::exists(memory));
}

/// An appliance that tries every 20 ms to leave safe mode, on its loop beside the test.
class StorageRetryTest : public testing::ApplianceTest {
 protected:
  StorageRetryTest() {
    parts_.demo_patient.clear();
    parts_.storage.retries = {std::chrono::milliseconds(20)};
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] std::string Fault() {
    std::string fault;
    On([&] { fault = appliance_->storage_fault(); });
    return fault;
  }
  [[nodiscard]] std::vector<AuditEntry> Recoveries() const {
    return appliance_->store()->audit.Find({0, 100, "storage.recovered"});
  }
  /// Waits until several attempts to leave safe mode have failed.
  void LetItTryInVain() {
    std::size_t before = 0;
    On([&] { before = appliance_->storage().num_retries(); });
    ASSERT_TRUE(Becomes([&] { return appliance_->storage().num_retries() >= before + 5; }));
  }
};

/// A renamed table makes reads fail for a while.
TEST_F(StorageRetryTest, SafeModeEndsWhenWhatIsStoredCanBeReadAgainAndNotBefore) {
  Play([&] {
    MakeReady();
    Database direct(state() / "plumb.db", Database::Access::kReadWrite);
    direct.Execute("ALTER TABLE checks RENAME TO away");
    On([&] { (void)appliance_->WebStatus(); });
    ASSERT_TRUE(Becomes([&] { return !appliance_->storage_fault().empty(); }));
    const std::string fault = Fault();
    LetItTryInVain();
    On([&] {
      EXPECT_EQ(appliance_->storage_fault(), fault);
      EXPECT_EQ(appliance_->WebStatus().state, ApplianceState::kFault);
      EXPECT_FALSE(appliance_->health().ok);
      EXPECT_EQ(Recoveries().size(), 0U);
    });
    direct.Execute("ALTER TABLE away RENAME TO checks");
    ASSERT_TRUE(Becomes([&] { return appliance_->storage_fault().empty(); }));
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().state, ApplianceState::kReady);
      EXPECT_EQ(appliance_->WebStatus().fault, "");
      EXPECT_TRUE(appliance_->health().ok) << appliance_->health().reason;
      ASSERT_EQ(Recoveries().size(), 1U);
      EXPECT_EQ(Recoveries()[0].detail, fault);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester), "") << "scans go on";
      EXPECT_EQ(appliance_->Cancel(kTester), "");
    });
  });
}

std::string StoreSmallScan(Store& store, const std::string& patient) {
  const std::string id = store.scans.Begin(
      {.patient_id = patient, .reference_id = {}, .purpose = {}, .sensor_serial = {}});
  fs::create_directory(store.folders.Staging(id) / "scene");
  WriteWholeFile(store.folders.Staging(id) / "scene" / "scene.json", std::string_view("{}"));
  store.scans.Finish(id, {.outcome = ScanOutcome::kDone, .swept_area_m2 = 0});
  return id;
}

/// Three scans of a patient, whose folder is then moved. Returns the patient.
std::string StoreAndHideScans(const Actor& tester, const fs::path& state, const fs::path& away) {
  std::string patient;
  {
    Store store(state);
    patient = store.patients.Add(tester, "A", "");
    for (int i = 0; i < 3; ++i) (void)StoreSmallScan(store, patient);
  }
  fs::rename(state / "scans", away);
  return patient;
}

/// As when the disk of the scans is mounted late.
TEST_F(StorageRetryTest, AStoreThatCouldNotBeOpenedIsOpenedWhenItsScansAreThere) {
  const std::string patient = StoreAndHideScans(kTester, state(), folder_ / "away");
  Play([&] {
    EXPECT_THAT(Fault(), HasSubstr("cannot be seen"));
    LetItTryInVain();
    EXPECT_THAT(Fault(), HasSubstr("cannot be seen"));
    EXPECT_THROW((void)appliance_->store()->patients.Add(kTester, "B", ""), DiskRefused)
        << "read-only";
    EXPECT_EQ(appliance_->store()->patients.List().size(), 1U);
    fs::rename(folder_ / "away", state() / "scans");
    ASSERT_TRUE(Becomes([&] { return appliance_->storage_fault().empty(); }));
    On([&] {
      EXPECT_EQ(appliance_->store()->scans.List(patient, 10).size(), 3U);
      EXPECT_NE(appliance_->store()->patients.Add(kTester, "B", ""), "");
      EXPECT_EQ(Recoveries().size(), 1U);
      EXPECT_TRUE(appliance_->health().ok) << appliance_->health().reason;
      EXPECT_EQ(appliance_->WebStatus().state, ApplianceState::kNoSensor);
    });
  });
}

/// As the engineer confirms it, with a file on a stick.
TEST_F(StorageRetryTest, ScansThatAreConfirmedAsLostEndSafeModeAndAreInTheLog) {
  const std::string patient = StoreAndHideScans(kTester, state(), folder_ / "away");
  Play([&] {
    EXPECT_THAT(Fault(), HasSubstr("lost_scans = 3"));
    const auto confirm = [&](int number) {
      return Becomes([&] {  // a try may hold the folder at this moment
        try {
          (void)RecoverUnit({.lost_scans = number, .backup = {}, .key_file = {}}, state(), {});
          return true;
        } catch (const DataError&) {
          return false;
        }
      });
    };
    ASSERT_TRUE(confirm(2));
    LetItTryInVain();
    EXPECT_THAT(Fault(), HasSubstr("lost_scans = 3"));
    ASSERT_TRUE(confirm(3));
    ASSERT_TRUE(Becomes([&] { return appliance_->storage_fault().empty(); }));
    On([&] {
      const auto entries = appliance_->store()->audit.Find({0, 10, "scans.lost"});
      ASSERT_EQ(entries.size(), 1U);
      EXPECT_THAT(entries[0].detail, HasSubstr("3 of 3"));
      EXPECT_EQ(appliance_->store()->scans.List(patient, 10).size(), 3U);
    });
    EXPECT_THROW((void)RecoverUnit({.lost_scans = 3, .backup = {}, .key_file = {}}, state(), {}),
                 DataError)
        << "a unit that works is left alone";
  });
}

/// The disk may be missing, or a backup about to be restored.
TEST_F(StorageRetryTest, SafeModeNeverEndsWithANewDatabase) {
  std::ofstream(state()) << "a file where the folder should be";
  Play([&] {
    EXPECT_NE(Fault(), "");
    fs::remove(state());
    fs::create_directory(state());
    LetItTryInVain();
    EXPECT_NE(Fault(), "");
    EXPECT_TRUE(fs::is_empty(state()));
  });
}

TEST(ApplianceStorage, ScansThatWereLostAreAWarningUntilTheyAreBack) {
  Surroundings around;
  const fs::path scans = around.config.appliance.state / "scans";
  std::string last;
  {
    Store store(around.config.appliance.state);
    const std::string patient = store.patients.Add({.user = "anna", .address = {}}, "A", "");
    for (int i = 0; i < 3; ++i) last = StoreSmallScan(store, patient);
  }
  fs::rename(scans / last, around.folder / "lost");
  const auto warns = [](Appliance& appliance) {
    const std::vector<std::string> warnings = appliance.WebStatus().storage.warnings;
    return std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
      return warning.starts_with("Files of some stored scans (1) are missing or changed");
    });
  };
  {
    Appliance appliance(around.loop, PartsOf(around.config, around.bus));
    EXPECT_TRUE(RunUntil(around.loop, [&] { return warns(appliance); }));
  }
  fs::rename(around.folder / "lost", scans / last);
  EventLoop another;
  Appliance appliance(another, PartsOf(around.config, around.bus));
  RunFor(another, std::chrono::milliseconds(1500));
  EXPECT_FALSE(warns(appliance));
}

}  // namespace
}  // namespace plumb
