// SPDX-License-Identifier: Apache-2.0
// Days of a unit's store by a clock of the test's own (clock_step.cpp, loaded before the others):
// checks, courses, accounts, backups, retention, power cuts, a full disk, certificates, the change
// to summer time and back, and 19 January 2038. In the end everything that was confirmed is
// accounted for, and memory, descriptors and disk have not grown.
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <ctime>
#include <fstream>
#include <iterator>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "daemon/archive/backup.hpp"
#include "daemon/archive/backup_register.hpp"
#include "daemon/archive/store_backup.hpp"
#include "daemon/database/row_digests.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/unit/records/store_fixture.hpp"
#include "web/security/certificate_care.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using std::chrono::hours;
using testing::kAnna;
using testing::kBert;
using Confirm = std::function<void(const std::string& line)>;

constexpr int kRetentionDays = 40;
const std::vector<std::string> kNames = {"plumb"};
constexpr hours kCertificateAge{24 * 755};  // due five days later
constexpr int kWholeYear = 365;

/// Days before the signed 32-bit seconds end that a short run begins; a whole one begins in June.
constexpr std::time_t kRollOver = 2'147'483'648;
constexpr int kShortBefore = 5, kWholeBefore = 220;

std::uint64_t BytesBelow(const fs::path& folder) {
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) bytes += entry.file_size();
  return bytes;
}

struct Use {
  long memory_kb = 0, descriptors = 0;
  std::uint64_t scans_bytes = 0, database_bytes = 0;
};

class SimulatedYearTest : public ::testing::Test {
 protected:
  SimulatedYearTest() {
    const char* const days = std::getenv("PLUMB_YEAR_DAYS");
    if (days != nullptr) num_days_ = std::atoi(days);
    ::setenv("TZ", "Europe/Berlin", 1);
    ::tzset();
    const bool is_whole = num_days_ >= kWholeYear;
    real_begin_ = WallClock::to_time_t(WallClock::now()) - Offset();
    begin_ = kRollOver - hours(24).count() * 3600 * (is_whole ? kWholeBefore : kShortBefore);
  }

  /// The clock of this process and of its children.
  static void SetOffset(std::time_t seconds) {
    std::ofstream(std::getenv("PLUMB_CLOCK_OFFSET")) << seconds;
  }
  static std::time_t Offset() {
    std::time_t seconds = 0;
    std::ifstream(std::getenv("PLUMB_CLOCK_OFFSET")) >> seconds;
    return seconds;
  }
  void GoTo(int day) { SetOffset(begin_ + day * 24L * 3600 - real_begin_); }

  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] Use UseNow() const;
  void MakeFirstDay();
  void WorkADay(Store& store, int day, const Confirm& confirm) const;
  static void TreatOne(Store& store, const std::string& patient, const std::string& reference,
                       const Confirm& confirm);
  void CareAtNight(Store& store, int day);
  void RestoreElsewhere();
  void CutTheDay(int day);
  void FillTheDisk(int day);
  void RenewCertificate();
  void Note(const std::string& line);
  void AccountForAll(Store& store) const;
  static std::set<std::string> RemovedByAge(Store& store);

  testing::TempFolder folder_;
  int num_days_ = 12;
  std::time_t begin_ = 0, real_begin_ = 0;
  std::mt19937 random_{2038};
  std::map<std::string, std::string> scans_, users_, plans_;  ///< What was confirmed: id to what.
  std::vector<std::string> backups_;
  std::optional<web::TlsIdentity> identity_;
  int num_cuts_ = 0, num_full_ = 0, num_renewed_ = 0, num_restored_ = 0, num_removed_ = 0;
};

Use SimulatedYearTest::UseNow() const {
  Use use;
  std::ifstream statm("/proc/self/statm");
  long pages = 0;
  statm >> pages >> pages;
  use.memory_kb = pages * (::sysconf(_SC_PAGESIZE) / 1024);
  use.descriptors = std::distance(fs::directory_iterator("/proc/self/fd"), {});
  use.scans_bytes = BytesBelow(state() / "scans");
  use.database_bytes = fs::file_size(state() / kDatabaseFile);
  return use;
}

void SimulatedYearTest::Note(const std::string& line) {
  std::istringstream words(line);
  std::string kind, id, what;
  words >> kind >> id >> what;
  (kind == "scan" ? scans_ : kind == "user" ? users_ : plans_)[id] = what;
}

void SimulatedYearTest::MakeFirstDay() {
  Store store(state());
  Settings settings;
  settings.retention_days = kRetentionDays;
  store.settings.Change(kAnna, settings);
  store.users.Add(kAnna, {.name = "eva",
                          .role = Role::kEngineer,
                          .password_hash = "first",
                          .disabled = false,
                          .created_at = {}});
  Note("user eva engineer");
  identity_ = web::MakeTlsIdentity(kNames, WallClock::now() - kCertificateAge);
}

/// A session of a course, from its opening to an accepted result.
void SimulatedYearTest::TreatOne(Store& store, const std::string& patient,
                                 const std::string& reference, const Confirm& confirm) {
  const std::string session = store.treatments.Open(kAnna, patient, ScanPurpose::kFraction);
  const std::string scan = store.scans.Begin({.patient_id = patient,
                                              .reference_id = reference,
                                              .purpose = ScanPurpose::kFraction,
                                              .sensor_serial = "S1",
                                              .reason = {},
                                              .session_id = session});
  testing::FillScan(store.folders.Staging(scan));
  store.scans.Finish(
      scan,
      {.outcome = ScanOutcome::kDone, .result_json = testing::ResultOfScan(), .swept_area_m2 = 1});
  confirm("scan " + scan + " done");
  store.scans.Accept(kAnna, scan);
  confirm("scan " + scan + " accepted");
  store.treatments.CloseAll(kAnna);
}

void SimulatedYearTest::WorkADay(Store& store, int day, const Confirm& confirm) const {
  TakenCheck taken;
  taken.check.status = MarkerCheckStatus::kPassed;
  (void)store.checks.Add(kAnna, "S1", taken);
  EXPECT_EQ(store.checks.StateSince(WallClock::now() - hours(12), "S1"), DailyCheck::kPassed);
  if (day % 3 == 0) {
    const std::string patient = store.patients.Add(kAnna, fmt::format("P-{}", day), "thorax");
    const std::string scan = testing::StoreScan(store, patient);
    confirm("scan " + scan + " done");
    const std::string reference =
        testing::PlanAndApprove(store, store.references.Add(kAnna, scan, "first", {}));
    confirm("plan " + reference + " approved");
  }
  if (day % 5 == 0) {
    const std::string name = fmt::format("tom{}", day);
    store.users.Add(kAnna, {.name = name,
                            .role = Role::kTechnician,
                            .password_hash = "first",
                            .disabled = false,
                            .created_at = {}});
    confirm("user " + name + " technician");
    if (day % 10 == 0) {
      store.users.Change(kAnna, {.name = name,
                                 .role = Role::kPhysicist,
                                 .disabled = {},
                                 .password_hash = {},
                                 .expected_hash = {}});
      confirm("user " + name + " physicist");
    }
  }
  int num_treated = 0;
  for (const Patient& patient : store.patients.List()) {
    store.audit.Log(kAnna, "login", "anna", "");
    const std::optional<Reference> reference = store.references.Approved(patient.id);
    if (reference && std::stoi(patient.code.substr(2)) > day - 9 && ++num_treated <= 3)
      TreatOne(store, patient.id, reference->id, confirm);
  }
}

void SimulatedYearTest::CareAtNight(Store& store, int day) {
  const fs::path backup = folder_ / fmt::format("backup-{}.tar", day % 3);
  fs::remove(backup);
  (void)StoreBackup(store).Make(kAnna, backup);
  backups_ = {backup};
  while (CheckNextBackup(store.database(), hours(24))) {
  }
  const int days = store.settings.Get().retention_days;
  num_removed_ += store.removal.RemoveOldScans(days).removed;
  if (day % 7 != 0) return;
  EXPECT_FALSE(store.audit.FirstBroken()) << day;
  Database disk(state() / kDatabaseFile, Database::Access::kFromDisk);
  UseRowKey(disk, state());
  EXPECT_TRUE(disk.CheckIntegrity());
  EXPECT_NO_THROW(RequireAllRows(disk)) << day;
  AccountForAll(store);
}

/// The newest backup on another unit.
void SimulatedYearTest::RestoreElsewhere() {
  const fs::path other = folder_ / "other";
  fs::remove_all(other);
  (void)RestoreBackup(backups_.back(), other);
  Store restored(other);
  AccountForAll(restored);
  ++num_restored_;
}

/// The power goes at any moment of the day: what the process had confirmed by then counts.
void SimulatedYearTest::CutTheDay(int day) {
  int ends[2] = {};
  ASSERT_EQ(::pipe2(ends, O_CLOEXEC), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    Store store(state());
    WorkADay(store, day, [&](const std::string& line) {
      const std::string text = line + "\n";
      if (::write(ends[1], text.data(), text.size()) < 0) ::_exit(1);
    });
    ::_exit(0);
  }
  ::close(ends[1]);
  std::string said(1, '\0'), line;
  for (auto until = random_() % 12; ::read(ends[0], said.data(), 1) == 1;) {
    if (said != "\n") {
      line += said;
      continue;
    }
    Note(line);
    line.clear();
    if (until-- == 0) ::kill(child, SIGKILL);
  }
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  ++num_cuts_;
}

/// A scan that has no room fails and leaves nothing; what is there stays.
void SimulatedYearTest::FillTheDisk(int day) {
  const auto outcome =
      testing::WriteOnFullDisk(fs::file_size(state() / kDatabaseFile) + 20'000, [&] {
        Store store(state());
        (void)testing::StoreScan(store, store.patients.Add(kAnna, fmt::format("F-{}", day), ""),
                                 [](const fs::path& folder) {
                                   testing::FillScan(folder);
                                   WriteWholeFile(folder / "scene" / "cloud.ply",
                                                  std::string(8'000'000, 'x'));
                                 });
      });
  EXPECT_EQ(outcome, testing::WriteOutcome::kIoError) << day;
  ++num_full_;
}

void SimulatedYearTest::RenewCertificate() {
  EXPECT_TRUE(web::CertificateWarnings(identity_->certificate_pem, WallClock::now()).empty());
  if (!web::IsDueForRenewal(identity_->certificate_pem, WallClock::now(), kNames)) return;
  identity_ = web::MakeTlsIdentity(kNames);
  ++num_renewed_;
}

std::set<std::string> SimulatedYearTest::RemovedByAge(Store& store) {
  std::set<std::string> removed;
  for (AuditQuery query{.before = 0, .limit = 1000, .actions = "scan.remove"};;) {
    const std::vector<AuditEntry> entries = store.audit.Find(query);
    for (const AuditEntry& entry : entries) removed.insert(entry.subject);
    if (entries.size() < 1000) return removed;
    query.before = entries.back().number;
  }
}

void SimulatedYearTest::AccountForAll(Store& store) const {
  const std::set<std::string> removed = RemovedByAge(store);
  for (const auto& [id, what] : scans_) {
    const std::optional<Scan> scan = store.scans.Find(id);
    EXPECT_EQ(scan.has_value(), !removed.contains(id)) << id;
    if (!scan) continue;
    EXPECT_EQ(scan->outcome, ScanOutcome::kDone) << id;
    EXPECT_TRUE(what != "accepted" || scan->accepted_by == "anna") << id;
    EXPECT_EQ(testing::FilesBelow(store.folders.Scan(id)).size(), std::size(testing::kScanFiles));
  }
  for (const auto& [name, role] : users_) {
    const std::optional<User> user = store.users.Find(name);
    ASSERT_TRUE(user) << name;
    EXPECT_EQ(Name(user->role), role) << name;
  }
  for (const auto& [id, what] : plans_) {
    const std::optional<Reference> reference = store.references.Find(id);
    ASSERT_TRUE(reference) << id;
    EXPECT_EQ(reference->approved_by, "bert") << id;
  }
}

TEST_F(SimulatedYearTest, EverythingThatWasConfirmedIsAccountedFor) {
  GoTo(0);
  ASSERT_LT(std::abs(WallClock::to_time_t(WallClock::now()) - begin_), 60)
      << "whose clock is this?";
  MakeFirstDay();
  Use half;
  for (int day = 0; day < num_days_ && !HasFailure(); ++day) {
    GoTo(day);
    RenewCertificate();
    if (day % 6 == 4) CutTheDay(day);
    if (day % 9 == 7) FillTheDisk(day);
    {
      Store store(state());
      if (day % 6 != 4) WorkADay(store, day, [&](const std::string& line) { Note(line); });
      CareAtNight(store, day);
    }
    if (day % 30 == 10) RestoreElsewhere();
    if (day == num_days_ / 2) half = UseNow();
  }
  {
    Store store(state());
    AccountForAll(store);
    EXPECT_EQ(store.recovery().lost_scans, 0);
  }
  const Use end = UseNow();
  std::printf(
      "%d days, %zu scans (%d removed by age), %zu accounts, %zu plans, %d cuts, %d full disks, %d "
      "restores, %d certificates; from half of the days on: memory %ld -> %ld kB, descriptors %ld "
      "-> %ld, scans %.1f -> %.1f MB, database %.2f -> %.2f MB\n",
      num_days_, scans_.size(), num_removed_, users_.size(), plans_.size(), num_cuts_, num_full_,
      num_restored_, num_renewed_, half.memory_kb, end.memory_kb, half.descriptors, end.descriptors,
      half.scans_bytes / 1e6, end.scans_bytes / 1e6, half.database_bytes / 1e6,
      end.database_bytes / 1e6);
  EXPECT_LE(end.descriptors, half.descriptors);
  EXPECT_LE(end.memory_kb, half.memory_kb + 20'000);
  EXPECT_GT(num_renewed_, 0);
  if (num_days_ < kWholeYear) return;
  EXPECT_GT(num_removed_, 0);
  EXPECT_LT(end.scans_bytes, half.scans_bytes * 2) << "what is removed makes room";
}

}  // namespace
}  // namespace plumb
