// SPDX-License-Identifier: Apache-2.0
// Removing scans, keeping sweeps that failed, a database that is held, and records that cannot be
// read.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/database/store_json.hpp"
#include "daemon/records/check_json.hpp"
#include "tests/support/message_of.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"
#include "words/result.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kAnna;
using testing::kBert;
using testing::MessageOf;
using testing::StoreScan;

class StoreCareTest : public ::testing::Test {
 protected:
  StoreCareTest() : store_(std::make_unique<Store>(state())) {
    patient_ = store_->patients.Add(kAnna, "P", "");
  }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  ChangeResult RefusalOfRemoving(const std::string& scan, const std::string& reason = "blurred") {
    try {
      store_->removal.RemoveScan(kBert, scan, reason);
    } catch (const StoreRefusal& refusal) {
      return refusal.result();
    }
    return ChangeResult::kDone;
  }
  /// As another version writes it, which keeps the digests of rows.
  void Execute(const std::string& sql) const { store_->database().ForChanges()->Execute(sql); }

  testing::TempFolder folder_;
  std::unique_ptr<Store> store_;
  std::string patient_;
};

TEST_F(StoreCareTest, AScanIsRemovedForAReasonAndAReferenceIsNot) {
  const std::string reference = StoreScan(*store_, patient_), scan = StoreScan(*store_, patient_);
  (void)store_->references.Add(kAnna, reference, "", {});
  const std::string running = store_->scans.Begin(testing::Begun(patient_));
  EXPECT_EQ(RefusalOfRemoving(scan, ""), ChangeResult::kInvalid);
  EXPECT_EQ(RefusalOfRemoving(reference), ChangeResult::kConflict) << "a draft is made of it";
  EXPECT_EQ(RefusalOfRemoving(running), ChangeResult::kConflict);
  for (const char* id : {"", "99", "../1"})
    EXPECT_EQ(RefusalOfRemoving(id), ChangeResult::kNotFound) << id;
  EXPECT_EQ(testing::FilesBelow(store_->folders.Scan(scan)).size(), 7U);
  EXPECT_EQ(RefusalOfRemoving(scan), ChangeResult::kDone);
  EXPECT_FALSE(store_->scans.Find(scan));
  EXPECT_FALSE(fs::exists(store_->folders.Scan(scan)));
  const AuditEntry logged = store_->audit.Find({0, 1}).at(0);
  EXPECT_EQ(
      logged.user + " " + logged.action + " " + logged.subject + ": " + logged.detail.English(),
      "bert scan.remove " + scan + ": blurred");
  EXPECT_EQ(RefusalOfRemoving(scan), ChangeResult::kNotFound);
}

class FailedSweepTest : public StoreCareTest, public ::testing::WithParamInterface<ScanOutcome> {};

TEST_P(FailedSweepTest, KeepsACompleteRecordingOfOneThatFailed) {
  const bool is_kept = GetParam() == ScanOutcome::kFailed;
  for (const bool is_complete : {true, false}) {
    const std::string id = store_->scans.Begin(testing::Begun(patient_));
    testing::FillScan(store_->folders.Staging(id));
    const fs::path recording = store_->folders.Staging(id) / "recording";
    fs::create_directories(recording / "rgb");
    WriteWholeFile(recording / "rgb" / "1.png", std::string_view("image"));
    if (is_complete) WriteWholeFile(recording / "rgb.txt", std::string_view("1 rgb/1.png"));
    store_->scans.Finish(id,
                         {.outcome = GetParam(), .failure = Message::Verbatim("marker not seen")});
    EXPECT_FALSE(fs::exists(store_->folders.Staging(id)));
    EXPECT_EQ(testing::FilesBelow(store_->folders.Scan(id)).size(),
              is_kept && is_complete ? 2U : 0U);
    EXPECT_EQ(store_->scans.Find(id)->failure.English(), "marker not seen");
    store_.reset();
    store_ = std::make_unique<Store>(state());
    EXPECT_EQ(store_->recovery().orphaned_folders + store_->recovery().lost_scans, 0);
    EXPECT_EQ(fs::exists(store_->folders.Scan(id)), is_kept && is_complete);
    if (!is_kept || !is_complete) continue;
    EXPECT_EQ(store_->integrity.Check(id, false).English(), "");
    EXPECT_THROW((void)store_->references.Add(kAnna, id, "", {}), StoreRefusal);
    EXPECT_EQ(store_->removal.KeepWithinQuota(0, testing::kAtOnce).removed > 0, true);
    EXPECT_FALSE(fs::exists(store_->folders.Scan(id) / "recording"));
  }
}

INSTANTIATE_TEST_SUITE_P(Outcomes, FailedSweepTest,
                         ::testing::Values(ScanOutcome::kFailed, ScanOutcome::kCancelled));

TEST_F(StoreCareTest, ADatabaseThatAnotherHoldsIsWaitedForWithinTheLimit) {
  store_.reset();
  // The locks are of processes: a child holds the file.
  const auto open = [&](int release_after) {
    int to_child[2] = {}, from_child[2] = {};
    EXPECT_EQ(::pipe(to_child) + ::pipe(from_child), 0);
    const pid_t child = ::fork();
    if (child == 0) {
      char byte = 0;
      {
        Database held(state() / "plumb.db", Database::Access::kReadWrite);
        (void)held.CheckIntegrity();  // takes the lock
        (void)!::write(from_child[1], "x", 1);
        (void)!::read(to_child[0], &byte, 1);
      }
      (void)!::write(from_child[1], "x", 1);
      ::_exit(0);
    }
    char byte = 0;
    (void)!::read(from_child[0], &byte, 1);
    int slept = 0;
    std::string result;
    StoreOptions options;
    options.busy_wait = std::chrono::milliseconds(10);
    options.lock_wait = std::chrono::seconds(2);
    options.sleep = [&](std::chrono::milliseconds pause) {
      EXPECT_EQ(pause, std::chrono::milliseconds(500));
      if (++slept != release_after) return;
      (void)!::write(to_child[1], "x", 1);
      (void)!::read(from_child[0], &byte, 1);
    };
    try {
      Store store(state(), options);
    } catch (const DatabaseBusy& error) {
      result = error.what();
      (void)!::write(to_child[1], "x", 1);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    for (const int fd : {to_child[0], to_child[1], from_child[0], from_child[1]}) ::close(fd);
    return fmt::format("{} {}", slept, result);
  };
  EXPECT_EQ(open(/*release_after=*/4), "4 ") << "2 s are four pauses";
  EXPECT_THAT(open(/*release_after=*/5),
              ::testing::AllOf(::testing::StartsWith("4 "), HasSubstr("locked")));
}

TEST_F(StoreCareTest, AnotherStoreOnTheFolderIsRefusedAtOnce) {
  StoreOptions options;
  options.sleep = [](std::chrono::milliseconds) { ADD_FAILURE() << "it does not let go"; };
  EXPECT_THAT(MessageOf<DatabaseBusy>([&] { Store second(state(), options); }),
              HasSubstr("another plumbd"));
  store_.reset();
  Store second(state(), options);
}

TEST_F(StoreCareTest, EveryFieldOfAPlanComesBackAsItWasStored) {
  const std::string scan = StoreScan(*store_, patient_);
  for (const char* posture : {"HFP", "FFS", "FFP", "HFS"}) {
    for (const bool couch_markers : {true, false}) {
      const ReferencePlan plan{.region_m = {{0.25, -0.5}, {1.5, 0.75}, {-1, 2}},
                               .isocentre_m = {{0.125, -0.25, 0.5}},
                               .tolerance = {.shift_mm = 7.5, .rotation_deg = 2.25},
                               .posture = posture,
                               .couch_markers = couch_markers,
                               .clothing_mm = 4.5,
                               .ct_breathing_mm = 6.25};
      const std::string id = store_->references.Add(kAnna, scan, "", plan);
      const ReferencePlan stored = store_->references.Find(id)->plan;
      EXPECT_EQ(stored.region_m, plan.region_m);
      EXPECT_EQ(stored.isocentre_m, plan.isocentre_m);
      EXPECT_EQ(stored.tolerance.shift_mm, 7.5);
      EXPECT_EQ(stored.tolerance.rotation_deg, 2.25);
      EXPECT_EQ(stored.posture, posture);
      EXPECT_EQ(stored.couch_markers, couch_markers);
      EXPECT_EQ(stored.clothing_mm, 4.5);
      EXPECT_EQ(stored.ct_breathing_mm, 6.25);
    }
  }
  // What was signed before these were known keeps its text, and its digest.
  EXPECT_EQ(PlanJson({}).find("clothing"), std::string::npos);
  EXPECT_EQ(PlanJson({}).find("breathing"), std::string::npos);
}

TEST_F(StoreCareTest, AStoredPlanThatCannotBeReadIsAnErrorAndNoDefault) {
  const std::string scan = StoreScan(*store_, patient_);
  const std::string id = store_->references.Add(kAnna, scan, "", {});
  const std::string good = PlanJson({});
  EXPECT_EQ(ParsePlan(good).tolerance.shift_mm, ReferencePlan{}.tolerance.shift_mm);
  for (
      const char* bad :
      {"", "null", "[]", "{", "{}",
       R"({"region_m":[],"shift_tolerance_mm":"3","rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false})",
       R"({"region_m":[],"shift_tolerance_mm":0,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":-1,"posture":"HFS","couch_markers":false})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HF","couch_markers":false})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":0})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS"})",
       R"({"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false})",
       R"({"region_m":[[0,0],[1,1]],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false})",
       R"({"region_m":[[0,0],[1,1],[1,null]],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false,"isocentre_m":[0,1]})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false,"clothing_mm":-1})",
       R"({"region_m":[],"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false,"ct_breathing_mm":101})"}) {
    Execute(fmt::format("UPDATE refs SET plan = '{}' WHERE id = {}", bad, id));
    EXPECT_THAT(MessageOf<DataError>([&] { (void)store_->references.Find(id); }),
                HasSubstr("version 1 of the reference"))
        << bad;
  }
  Execute(fmt::format("UPDATE refs SET plan = '{}' WHERE id = {}", good, id));
  EXPECT_TRUE(store_->references.Find(id));
}

TEST_F(StoreCareTest, StoredSettingsThatCannotBeReadAreAnErrorAndOlderOnesAreNot) {
  Settings settings;
  settings.retention_days = 7;
  store_->settings.Change(kAnna, settings);
  const std::string good = SettingsJson(settings);
  const auto store = [&](const std::string& text) {
    Execute(fmt::format("UPDATE settings SET value = '{}'", text));
  };
  for (
      const char* bad :
      {"", "null", "{}", R"({"shift_tolerance_mm":3})",
       R"({"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false,"retention_days":"7"})",
       R"({"shift_tolerance_mm":3,"rotation_tolerance_deg":1,"posture":"HFS","couch_markers":false,"retention_days":-7})"}) {
    store(bad);
    EXPECT_THAT(MessageOf<DataError>([&] { (void)store_->settings.Get(); }), HasSubstr("settings"))
        << bad;
  }
  store(
      R"({"shift_tolerance_mm":4,"rotation_tolerance_deg":1,"posture":"FFS","couch_markers":true})");
  EXPECT_EQ(store_->settings.Get().tolerance.shift_mm, 4);
  EXPECT_EQ(store_->settings.Get().idle_logout_min, Settings{}.idle_logout_min);
  store(good);
  EXPECT_EQ(store_->settings.Get().retention_days, 7);
}

TEST_F(StoreCareTest, TheLogTellsWhichSettingsWereChangedBeforeAndAfter) {
  Settings settings;
  store_->settings.Change(kAnna, settings);
  settings.retention_days = 7;
  settings.posture = "FFS";
  store_->settings.Change(kAnna, settings);
  const auto detail = [&] {
    return store_->audit.Find({.before = 0, .limit = 1}).front().detail.English();
  };
  EXPECT_EQ(detail(), R"({"posture":["HFS","FFS"],"retention_days":[0,7]})");
  store_->settings.Change(kAnna, settings);
  EXPECT_EQ(detail(), "{}");
  Execute("UPDATE settings SET value = 'damaged'");
  store_->settings.Change(kAnna, settings);  // what cannot be read is put right, and told whole
  EXPECT_THAT(detail(), HasSubstr(R"("retention_days":[7])"));
}

TEST_F(StoreCareTest, AStoredResultThatCannotBeReadIsAnErrorAndMissingNumbersAreNoZeros) {
  const std::string angles = R"("pitch_deg":1,"roll_deg":2,"yaw_deg":3)";
  const auto with = [](const std::string& correction) {
    return testing::ResultWith(R"({"verdict":"move","correction":)" + correction + "}");
  };
  const ResultSummary couch = SummaryOf(with("{\"vertical_mm\":null," + angles + "}"));
  EXPECT_EQ(couch.correction->vertical_mm, std::nullopt) << "markers on the couch show no shift";
  EXPECT_EQ(couch.correction->yaw_deg, 3.0);
  EXPECT_FALSE(couch.u95->yaw_deg);
  EXPECT_EQ(couch.judgements[5], NumberJudgement::kOutside);
  EXPECT_EQ(couch.judgements[0], NumberJudgement::kUnjudged);
  EXPECT_EQ(SummaryOf(testing::ResultWith(R"({"verdict":"no_answer","correction":null})")).verdict,
            Verdict::kNoAnswer);
  for (const std::string& bad :
       {std::string(), std::string("[]"), std::string("{}"),
        testing::ResultWith(R"({"verdict":1})"), testing::ResultWith(R"({"verdict":"fine"})"),
        testing::ResultWith(R"({"verdict":"move","reasons":"one"})"), with("7"), with("{}"),
        with(R"({"pitch_deg":1,"roll_deg":2})"),
        with(R"({"pitch_deg":1,"roll_deg":2,"yaw_deg":null})"),
        with("{\"lateral_mm\":\"4\"," + angles + "}"),
        with("{" + angles + R"(,"uncertainty":[]})")}) {
    EXPECT_THAT(MessageOf<DataError>([&] { (void)SummaryOf(bad); }), HasSubstr("stored result"))
        << bad;
  }
}

TEST_F(StoreCareTest, AStoredNameThatIsNoneOfOursIsAnErrorAndAnAccountOfSuchARoleIsClosed) {
  store_->users.Add(kAnna, {.name = "erik",
                            .role = Role::kEngineer,
                            .password_hash = "x",
                            .disabled = false,
                            .created_at = {}});
  const std::string scan = StoreScan(*store_, patient_);
  EXPECT_FALSE(store_->users.Find("erik")->disabled);
  const auto change = [&](const std::string& column, const std::string& row) {
    Execute("PRAGMA ignore_check_constraints = ON; UPDATE " + column + " = 'other' WHERE " + row);
  };
  change("users SET role", "name = 'erik'");
  change("scans SET purpose", "id = " + std::to_string(std::stoi(scan)));
  EXPECT_TRUE(store_->users.Find("erik")->disabled);
  ASSERT_EQ(store_->users.List().size(), 1U) << "an appliance without accounts offers to make one";
  EXPECT_THAT(MessageOf<DataError>([&] { (void)store_->scans.Find(scan); }),
              HasSubstr("purpose 'other'"));
}

TEST_F(StoreCareTest, APlanThatCannotBeReadHidesNoOtherOfThePatient) {
  const std::string first = store_->references.Add(kAnna, StoreScan(*store_, patient_), "", {});
  const std::string second = store_->references.Add(kAnna, StoreScan(*store_, patient_), "", {});
  Execute("UPDATE refs SET plan = '{' WHERE id = " + second);
  store_.reset();
  store_ = std::make_unique<Store>(state());
  const std::vector<Reference> references = store_->references.List(patient_);
  ASSERT_EQ(references.size(), 2U);
  EXPECT_EQ(references[0].id, second);
  EXPECT_THAT(references[0].unreadable.English(), HasSubstr("cannot be read"));
  EXPECT_EQ(references[1].unreadable.English(), "");
  EXPECT_THROW((void)store_->references.Find(second), DataError) << "never used as a default";
  EXPECT_EQ(store_->references.Find(first)->id, first);
}

TEST_F(StoreCareTest, AScanThatCannotBeReadHidesNoOtherOfThePatient) {
  std::vector<std::string> scans;
  for (int i = 0; i < 4; ++i) scans.push_back(StoreScan(*store_, patient_));
  Execute(
      "PRAGMA ignore_check_constraints = ON; UPDATE results SET json = '{' WHERE scan_id = 2; "
      "UPDATE scans SET purpose = 'other' WHERE id = 3; UPDATE scans SET outcome = 'other', "
      "started_at = 9000000000000000000 WHERE id = 4");
  for (const std::string& of : {patient_, std::string()}) {
    const std::vector<Scan> listed = store_->scans.List(of, 10);
    ASSERT_EQ(listed.size(), 4U);
    EXPECT_EQ(listed[3].id, scans[0]);
    EXPECT_TRUE(listed[3].result);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(listed[i].id, scans[3 - i]);
      EXPECT_EQ(listed[i].patient_id, patient_);
      EXPECT_EQ(listed[i].outcome, ScanOutcome::kFailed);
      EXPECT_FALSE(listed[i].result);
      EXPECT_THAT(listed[i].failure.English(),
                  ::testing::AnyOf(HasSubstr("stored"), HasSubstr("result.json")));
      EXPECT_THROW((void)store_->scans.Find(listed[i].id), DataError) << "never acted on";
    }
    EXPECT_GT(listed[0].started_at, listed[1].started_at) << "a stamp beyond the clock's range";
  }
}

TEST_F(StoreCareTest, AResultNamesThePointAboutWhichItsNumbersAre) {
  const auto about = [](const char* centroid_m) {
    return SummaryOf(testing::ResultWith(fmt::format(
                         R"({{"verdict":"move","correction":{{"isocentre":[0.1,0.2,0.3],)"
                         R"("pitch_deg":1,"roll_deg":2,"yaw_deg":3}},)"
                         R"("motion":{{"centroid_m":{}}}}})",
                         centroid_m)))
        .about;
  };
  EXPECT_EQ(about("[0.1,0.2,0.3]"), say::result::AboutMiddle());
  EXPECT_EQ(about("[0.1,0.2,0.4]"), say::result::AtIsocentre());
}

TEST_F(StoreCareTest, AResultAndACheckAreReadWithTheirMessages) {
  const ResultSummary result = SummaryOf(testing::ResultWith(
      R"({"verdict":"no_answer","reasons":["it has no files","of an older version"],)"
      R"("reason_messages":[{"id":"store.no_files","arguments":{}},{"id":"none.such"}],)"
      R"("correction":{"pitch_deg":1,"roll_deg":2,"yaw_deg":3,"words":{"pitch":"note"},)"
      R"("word_messages":{"pitch":{"id":"store.log_note","arguments":{}}}},)"
      R"("body":{"parts":[{"words_now":"site","words_after":"as it is",)"
      R"("words_now_message":{"id":"store.log_site","arguments":{}}}]}})"));
  EXPECT_THAT(result.reasons, ::testing::ElementsAre(say::store::NoFiles(),
                                                     Message::Verbatim("of an older version")));
  EXPECT_EQ(result.words[3], say::store::LogNote());
  EXPECT_TRUE(result.words[4].empty());
  EXPECT_THAT(result.body_now, ::testing::ElementsAre(say::store::LogSite()));
  EXPECT_THAT(result.body_after, ::testing::ElementsAre(Message::Verbatim("as it is")));
  const CheckRecord check =
      CheckIn(R"({"status":"failed","reasons":["it has no files"],"reason_messages":[{"id":)"
              R"("store.no_files","arguments":{}}],"items":[{"name":"moved","note":"site",)"
              R"("note_message":{"id":"store.log_site","arguments":{}}}]})");
  EXPECT_THAT(check.reasons, ::testing::ElementsAre(say::store::NoFiles()));
  EXPECT_EQ(check.items.at(0).note, say::store::LogSite());
}

TEST_F(StoreCareTest, ACheckThatCannotBeReadHasNotPassed) {
  for (const char* bad :
       {"", "[]", "{}", R"({"status":1})", R"({"status":"fine"})",
        R"({"status":"passed","items":[1]})", R"({"status":"passed","reasons":7})"}) {
    const CheckRecord record = CheckIn(bad);
    EXPECT_EQ(record.status, MarkerCheckStatus::kFailed) << bad;
    EXPECT_THAT(EnglishTexts(record.reasons), ::testing::ElementsAre(HasSubstr("cannot be read")))
        << bad;
  }
}

TEST_F(StoreCareTest, TheCheckOfTheDatabaseEndsInTime) {
  for (int i = 0; i < 300; ++i) store_->audit.Log(kAnna, "note", "", std::string(1000, 'n'));
  Database database(state() / "plumb.db", Database::Access::kReadOnly);
  EXPECT_TRUE(database.CheckIntegrity());
  EXPECT_FALSE(database.CheckIntegrity(std::chrono::milliseconds(-1)));
  EXPECT_TRUE(database.CheckIntegrity()) << "the limit was for that check";
}

TEST(RestrictAccessTest, TakesBackWhatAnOlderVersionGaveAndNothingElse) {
  const testing::TempFolder folder;
  const fs::path state = folder / "state";
  std::string scan;
  {
    Store store(state);
    scan = testing::StoreScan(store, store.patients.Add(testing::kAnna, "P", ""));
  }
  WriteWholeFile(folder / "elsewhere", std::string_view("x"));
  fs::permissions(folder / "elsewhere", fs::perms(0666));
  fs::create_symlink(folder / "elsewhere", state / "scans" / scan / "link");
  const fs::path cloud = state / "scans" / scan / "scene" / "cloud.ply";
  const auto mode = [](const fs::path& path) { return fs::status(path).permissions(); };
  const auto open_up = [&] {
    fs::permissions(state, fs::perms(0755));
    fs::permissions(state / "scans", fs::perms(0777));
    fs::permissions(state / "plumb.db", fs::perms(0664));
    fs::permissions(cloud, fs::perms(0644));
  };
  (void)RestrictAccess(state);
  open_up();
  EXPECT_EQ(RestrictAccess(state), 4);
  EXPECT_EQ(mode(state), fs::perms(0750));
  EXPECT_EQ(mode(state / "scans"), fs::perms(0750));
  EXPECT_EQ(mode(state / "plumb.db"), fs::perms(0640));
  EXPECT_EQ(mode(cloud), fs::perms(0640));
  EXPECT_EQ(mode(folder / "elsewhere"), fs::perms(0666)) << "a link is not followed";
  fs::permissions(state, fs::perms(0700));
  EXPECT_EQ(RestrictAccess(state), 0);
  EXPECT_EQ(mode(state), fs::perms(0700)) << "the stricter mode of the service";
  EXPECT_EQ(RestrictAccess(folder / "missing"), 0);
}

}  // namespace
}  // namespace plumb
