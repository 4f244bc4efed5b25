// SPDX-License-Identifier: Apache-2.0
// An appliance whose database fails under it.
#include <algorithm>
#include <chrono>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/archive/age_file.hpp"
#include "daemon/services/web_services.hpp"
#include "daemon/unit/unit_recovery.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/fake_sensor.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "tests/unit/archive/age_keys.hpp"

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
  SharedParts shared(
      around.loop,
      {.config = around.config,
       .make_provider = [&] { return std::make_unique<testing::FakeProvider>(around.bus); },
       .before_scan = {},
       .button = nullptr,
       .indicator = nullptr,
       .demo_patient = {},
       .storage = {.retries = {std::chrono::milliseconds(1)}}});
  Appliance appliance(shared);
  for (const fs::directory_entry& entry : fs::directory_iterator(around.config.appliance.state)) {
    if (!entry.is_regular_file()) continue;
    std::fstream file(entry.path(), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(100);  // behind the header
    file << std::string(fs::file_size(entry.path()), 'x');
  }
  EXPECT_EQ(appliance.WebStatus().state, ApplianceState::kNoSensor);
  // Rows are read from memory, so that the daily check notices it. The first one relies on that of
  // the start.
  shared.upkeep.Run();
  shared.upkeep.Run();
  RunFor(around.loop, std::chrono::milliseconds(300));
  EXPECT_THAT(shared.storage.fault().English(),
              ::testing::AnyOf(HasSubstr("damaged"), HasSubstr("is not as it was written")))
      << "and it is not tried again";
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
  parts.storage.configuration_fault = Message::Verbatim("cannot read /media/\xff.toml");
  SharedParts shared(around.loop, parts);
  Appliance appliance(shared);
  EXPECT_EQ(shared.storage.fault().English(), "cannot read /media/\xEF\xBF\xBD.toml");
}

TEST(ApplianceStorage, AListenerThatFailsIsReportedAndDoesNotEndTheLoop) {
  Surroundings around;
  SharedParts shared(around.loop, PartsOf(around.config, around.bus));
  Appliance appliance(shared);
  int lines = 0, notices = 0;
  shared.notices.SetWatchers([&](const std::string&) {
    ++lines;
    throw std::runtime_error("the socket is gone");
  });
  shared.notices.SetPage([&](web::EventKind) {
    ++notices;
    throw std::bad_alloc();
  });
  around.loop.Post("test", [&] {
    appliance.SetRolledBack(Message::Verbatim("the update was rolled back"));
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
    SharedParts shared(around.loop, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    const auto is_told = [&] {
      const std::vector<std::string> warnings =
          EnglishTexts(appliance.WebStatus().storage.warnings);
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
    SharedParts shared(around.loop, std::move(parts));
    Appliance appliance(shared);
    // A damaged page that the start reads is found at once, by its checksum.
    if (!is_damaged) {
      EXPECT_EQ(shared.storage.fault().English(), "") << "the start did not wait for the check";
    }
    const auto is_found = [&] { return !shared.storage.fault().empty(); };
    if (is_damaged) {
      EXPECT_TRUE(RunUntil(around.loop, is_found));
      EXPECT_THAT(shared.storage.fault().English(), HasSubstr("is not as it was written"));
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
  SharedParts shared(around.loop, PartsOf(around.config, around.bus));
  const Appliance appliance(shared);
  EXPECT_THAT(shared.storage.fault().English(), HasSubstr("is not as it was written"));
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
    // As another version writes it, which keeps the digests of rows.
    Store store(around.config.appliance.state);
    store.database().ForChanges()->Execute("UPDATE settings SET value = '" + text +
                                           "' WHERE name = 'settings'");
  };
  {
    SharedParts shared(around.loop, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    StoreAccess access(shared.loop, shared.storage, shared.store_thread, shared.notices);
    EXPECT_EQ(MakeWebSettings(shared.notices, access)->GetSettings().idle_logout_min, 7);
  }
  set("{");
  EventLoop another;
  SharedParts shared(another, PartsOf(around.config, around.bus));
  Appliance appliance(shared);
  StoreAccess access(shared.loop, shared.storage, shared.store_thread, shared.notices);
  EXPECT_THAT(testing::MessageOf<IoError>(
                  [&] { (void)MakeWebSettings(shared.notices, access)->GetSettings(); }),
              HasSubstr("what is stored cannot be read: the stored settings cannot be read: "))
      << "the page goes by this sentence";
  // A complete set replaces them.
  Settings entered;
  entered.idle_logout_min = 9;
  std::optional<Change> changed;
  const auto settings = MakeWebSettings(shared.notices, access);
  settings->ChangeSettings({.user = "anna", .address = {}}, entered,
                           [&](const Change& change) { changed = change; });
  EXPECT_TRUE(RunUntil(another, [&] { return changed.has_value(); }));
  EXPECT_EQ(changed->result, ChangeResult::kDone);
  EXPECT_EQ(settings->GetSettings().idle_logout_min, 9);
}

TEST(ApplianceStorage, ABackupIsMadeOffTheLoopAndRefusedInSafeMode) {
  Surroundings around;
  {
    SharedParts shared(around.loop, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    EXPECT_TRUE(shared.upkeep.BackupTarget().empty());
    std::optional<std::string> made, refused;
    shared.upkeep.BackUp({.user = "anna", .address = {}}, around.folder / "backup",
                         [&](const Message& error, const BackupReport& report) {
                           made = error.English();
                           EXPECT_EQ(report.files, 1U);
                         });
    shared.upkeep.BackUp(
        {.user = "anna", .address = {}}, "/proc/backup",
        [&](const Message& error, const BackupReport&) { refused = error.English(); });
    EXPECT_FALSE(made || refused) << "the loop does not wait";
    EXPECT_TRUE(RunUntil(around.loop, [&] { return made && refused; }));
    EXPECT_EQ(made, "");
    EXPECT_THAT(refused.value_or(""), HasSubstr("/proc"));
  }
  EXPECT_EQ(RestoreBackup(around.folder / "backup", around.folder / "restored").files, 1U);
  // With recipients in the configuration every backup is encrypted, the clock's and the page's too.
  {
    around.config.appliance.backup_recipients = AgeRecipients({testing::kRecipient});
    EventLoop another;
    SharedParts shared(another, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    std::optional<std::string> made, made_for_other;
    shared.upkeep.BackUp(
        {.user = "anna", .address = {}}, around.folder / "sealed",
        [&](const Message& error, const BackupReport&) { made = error.English(); });
    shared.upkeep.BackUp(
        {.user = "anna", .address = {}}, around.folder / "other",
        [&](const Message& error, const BackupReport& report) {
          made_for_other = error.English() + report.target.string();
        },
        AgeRecipients({testing::kOtherRecipient}));
    EXPECT_TRUE(RunUntil(another, [&] { return made && made_for_other; }));
    EXPECT_EQ(made, "");
    EXPECT_EQ(made_for_other, (around.folder / "other.tar.age").string());
  }
  std::ofstream(around.folder / "id") << testing::kIdentity;
  const AgeIdentity identity(around.folder / "id");
  const BackupKeys keys{.identity = &identity};
  EXPECT_EQ(
      RestoreBackup(around.folder / "sealed.tar.age", around.folder / "opened", {}, keys).files,
      1U);
  EXPECT_THROW(
      (void)RestoreBackup(around.folder / "other.tar.age", around.folder / "unopened", {}, keys),
      DataError);
  // Where 0.2.0 encrypted, nothing is written plain because the new keys are missing.
  {
    around.config.appliance.backup_recipients = {};
    around.config.appliance.backup_key_file = around.folder / "key";
    EventLoop another;
    SharedParts shared(another, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    std::string refused;
    shared.upkeep.BackUp(
        {.user = "anna", .address = {}}, around.folder / "plain",
        [&](const Message& error, const BackupReport&) { refused = error.English(); });
    EXPECT_THAT(refused, HasSubstr("backup_recipients"));
    EXPECT_FALSE(fs::exists(around.folder / "plain"));
  }
  {
    std::ofstream(around.config.appliance.state / "plumb.db") << std::string(20000, 'x');
    EventLoop another;
    SharedParts shared(another, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    std::string answer;
    shared.upkeep.BackUp(
        {.user = "anna", .address = {}}, around.folder / "other",
        [&](const Message& error, const BackupReport&) { answer = error.English(); });
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
      SharedParts shared(around.loop, PartsOf(around.config, around.bus));
      Appliance appliance(shared);
      std::optional<std::string> made;
      shared.upkeep.BackUp(
          {.user = "anna", .address = {}}, shared.upkeep.BackupTarget(),
          [&](const Message& error, const BackupReport&) { made = error.English(); });
      EXPECT_TRUE(RunUntil(around.loop, [&] { return made.has_value(); }));
      EXPECT_EQ(made, "");
      const std::vector<std::string> warnings =
          EnglishTexts(appliance.WebStatus().storage.warnings);
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
  SharedParts shared(around.loop, PartsOf(around.config, around.bus));
  Appliance appliance(shared);
  std::optional<std::string> refused;
  shared.upkeep.BackUp(
      {.user = "anna", .address = {}}, memory,
      [&](const Message& error, const BackupReport&) { refused = error.English(); });
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
    On([&] { fault = shared_->storage.fault().English(); });
    return fault;
  }
  [[nodiscard]] std::vector<AuditEntry> Recoveries() const {
    return shared_->store->audit.Find({0, 100, "storage.recovered"});
  }
  /// Waits until several attempts to leave safe mode have failed.
  void LetItTryInVain() {
    std::size_t before = 0;
    On([&] { before = shared_->storage.num_retries(); });
    ASSERT_TRUE(Becomes([&] { return shared_->storage.num_retries() >= before + 5; }));
  }
};

/// A renamed table makes reads fail for a while.
TEST_F(StorageRetryTest, SafeModeEndsWhenWhatIsStoredCanBeReadAgainAndNotBefore) {
  Play([&] {
    MakeReady();
    Database direct(state() / "plumb.db", Database::Access::kReadWrite);
    direct.Execute("ALTER TABLE checks RENAME TO away");
    On([&] { (void)appliance_->WebStatus(); });
    ASSERT_TRUE(Becomes([&] { return !shared_->storage.fault().empty(); }));
    const std::string fault = Fault();
    LetItTryInVain();
    On([&] {
      EXPECT_EQ(shared_->storage.fault().English(), fault);
      EXPECT_EQ(appliance_->WebStatus().state, ApplianceState::kFault);
      EXPECT_FALSE(appliance_->health().ok);
      EXPECT_EQ(Recoveries().size(), 0U);
    });
    direct.Execute("ALTER TABLE away RENAME TO checks");
    ASSERT_TRUE(Becomes([&] { return shared_->storage.fault().empty(); }));
    On([&] {
      EXPECT_EQ(appliance_->WebStatus().state, ApplianceState::kReady);
      EXPECT_EQ(appliance_->WebStatus().fault.English(), "");
      EXPECT_TRUE(appliance_->health().ok) << appliance_->health().reason.English();
      ASSERT_EQ(Recoveries().size(), 1U);
      EXPECT_EQ(Recoveries()[0].detail.English(), fault);
      EXPECT_EQ(appliance_->Press(ButtonPress::kShort, kTester).English(), "") << "scans go on";
      EXPECT_EQ(appliance_->Cancel(kTester).English(), "");
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
    EXPECT_THROW((void)shared_->store->patients.Add(kTester, "B", ""), DiskRefused) << "read-only";
    EXPECT_EQ(shared_->store->patients.List().size(), 1U);
    fs::rename(folder_ / "away", state() / "scans");
    ASSERT_TRUE(Becomes([&] { return shared_->storage.fault().empty(); }));
    On([&] {
      EXPECT_EQ(shared_->store->scans.List(patient, 10).size(), 3U);
      EXPECT_NE(shared_->store->patients.Add(kTester, "B", ""), "");
      EXPECT_EQ(Recoveries().size(), 1U);
      EXPECT_TRUE(appliance_->health().ok) << appliance_->health().reason.English();
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
          (void)RecoverUnit({.lost_scans = number, .backup = {}, .key_file = {}, .identity = {}},
                            state(), {});
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
    ASSERT_TRUE(Becomes([&] { return shared_->storage.fault().empty(); }));
    On([&] {
      const auto entries = shared_->store->audit.Find({0, 10, "scans.lost"});
      ASSERT_EQ(entries.size(), 1U);
      EXPECT_THAT(entries[0].detail.English(), HasSubstr("3 of 3"));
      EXPECT_EQ(shared_->store->scans.List(patient, 10).size(), 3U);
    });
    EXPECT_THROW((void)RecoverUnit({.lost_scans = 3, .backup = {}, .key_file = {}, .identity = {}},
                                   state(), {}),
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
    const std::vector<std::string> warnings = EnglishTexts(appliance.WebStatus().storage.warnings);
    return std::any_of(warnings.begin(), warnings.end(), [](const std::string& warning) {
      return warning.starts_with("Files of some stored scans (1) are missing or changed");
    });
  };
  {
    SharedParts shared(around.loop, PartsOf(around.config, around.bus));
    Appliance appliance(shared);
    EXPECT_TRUE(RunUntil(around.loop, [&] { return warns(appliance); }));
  }
  fs::rename(around.folder / "lost", scans / last);
  EventLoop another;
  SharedParts shared(another, PartsOf(around.config, around.bus));
  Appliance appliance(shared);
  RunFor(another, std::chrono::milliseconds(1500));
  EXPECT_FALSE(warns(appliance));
}

}  // namespace
}  // namespace plumb
