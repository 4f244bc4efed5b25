// SPDX-License-Identifier: Apache-2.0
// The n-th call to the system fails, for every n and every kind of call, while a scan is stored,
// while a store starts after a crash, and while a backup is made or restored: nothing that was
// finished is lost, and the next start puts the rest right. Then databases that are not what was
// written.
#include <cstdlib>
#include <map>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/factory_reset.hpp"
#include "daemon/archive/store_backup.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/result/result_folder.hpp"
#include "daemon/update/bundle_copy.hpp"
#include "tests/support/failing_calls.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/files/small_output.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::Arm;
using testing::CallFault;
using testing::Disarm;
using testing::FailingCall;
using testing::kAnna;
using testing::PlanAndApprove;
using testing::StoreScan;

constexpr const char* kCallNames[] = {"open", "write", "sync", "rename", "mkdir"};

/// So many times as many rounds, and each call: for long runs.
constexpr const char* kRepeats = "PLUMB_FAULT_REPEATS";
int Repeats() {
  const char* text = std::getenv(kRepeats);
  return text == nullptr ? 1 : std::max(1, std::atoi(text));
}
/// Of the calls that fail in the usual run, which is a sample: all of them take 100 s of processor
/// time.
long StrideOfSample() { return std::getenv(kRepeats) == nullptr ? 3 : 1; }

class FailingDiskTest : public ::testing::Test {
 protected:
  FailingDiskTest() {
    Store store(prepared());
    patient_ = store.patients.Add(kAnna, "P", "");
    reference_ = StoreScan(store, patient_);
    (void)PlanAndApprove(store, store.references.Add(kAnna, reference_, "", {}));
    for (int i = 0; i < 2; ++i) (void)StoreScan(store, patient_);
    const std::string interrupted = store.scans.Begin(testing::Begun(patient_));
    testing::FillScan(store.folders.Staging(interrupted));
    WriteCompared(folder_ / "compared");
    compared_ = testing::FilesBelow(folder_ / "compared");
  }
  void SetUp() override {
    if (!Arm({})) PLUMB_SKIP("the library of failing calls is not loaded: run it through ctest");
  }

  [[nodiscard]] fs::path prepared() const { return folder_ / "prepared"; }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }
  [[nodiscard]] fs::path backup() const { return folder_ / "backup"; }

  /// The files of a compared scan, by the writers that plumbd stores it with.
  static void WriteCompared(const fs::path& folder) {
    static const Comparison kComparison = testing::Answer();
    static const HeightMap kReference = testing::Slope(0.0);
    static const ResultPictures kPictures = DrawResult(kComparison, &kReference);
    WriteScene(testing::SmallScene(), folder / "scene");
    WriteResult(kComparison, kPictures, folder / "result");
  }
  void Prepare() const {
    for (const char* name : {"state", "backup", "backup.tar", "restored"})
      fs::remove_all(folder_ / name);
    fs::copy(prepared(), state(), fs::copy_options::recursive);
  }

  /// Whatever was finished is whole, before and after the next start.
  void ExpectNothingLost(const std::vector<std::string>& finished) const {
    for (const std::string& scan : finished) {
      const auto files = testing::FilesBelow(state() / "scans" / scan);
      if (scan > "000003") {
        EXPECT_TRUE(files == compared_) << scan;
      } else {
        EXPECT_EQ(files.size(), std::size(testing::kScanFiles)) << scan;
      }
    }
    Store store(state());
    for (const std::string& scan : finished) {
      const auto found = store.scans.Find(scan);
      ASSERT_TRUE(found) << scan;
      EXPECT_EQ(found->outcome, ScanOutcome::kDone);
      EXPECT_EQ(found->failure, Message());
      EXPECT_EQ(store.integrity.Check(scan, false).English(), "");
    }
    EXPECT_EQ(store.audit.FirstBroken(), std::nullopt);
    EXPECT_EQ(store.references.Approved(patient_)->scan_id, reference_);
    (void)StoreScan(store, patient_);  // and it goes on
  }

  /// Calls `round` with each fault in turn, until one is not met any more.
  template <typename Round>
  /// @param stride  Only each such call fails: for what shares most of its calls with another test.
  void ForEachFault(const char* what, const Round& round, long stride = 1) {
    struct Kind {
      int error;
      bool for_good;
    };
    int rounds = 0, met = 0;
    stride = std::max(stride, StrideOfSample());
    for (int repeat = 0; repeat < Repeats(); ++repeat) {
      for (int call = 0; call < testing::kNumFailingCalls; ++call) {
        for (const Kind kind : {Kind{EIO, false}, Kind{ENOSPC, true}, Kind{0, false}}) {
          if (kind.error == 0 && call != static_cast<int>(FailingCall::kWrite)) continue;
          for (long nth = 1 + call % stride;; nth += stride) {
            SCOPED_TRACE(fmt::format("{}: {} number {}, {}{}", what, kCallNames[call], nth,
                                     kind.error == 0 ? "cut short" : std::strerror(kind.error),
                                     kind.for_good ? " for good" : ""));
            Prepare();
            const std::string below = folder_.path().string();
            const long failed = round(CallFault{static_cast<FailingCall>(call), nth, kind.error,
                                                kind.for_good, below.c_str()});
            ++rounds;
            met += failed > 0 ? 1 : 0;
            if (::testing::Test::HasFailure() || failed == 0) break;
          }
          if (::testing::Test::HasFailure()) return;
        }
      }
    }
    RecordProperty(std::string(what) + " rounds", rounds);
    fmt::print("{}: {} rounds, {} with a call that failed\n", what, rounds, met);
    EXPECT_GT(met, 30) << "the library must be in effect";
  }

  testing::TempFolder folder_;
  std::string patient_, reference_;
  std::map<std::string, std::string> compared_;  ///< What WriteCompared() writes.
};

TEST_F(FailingDiskTest, WhileAScanIsStored) {
  ForEachFault("storing a scan", [&](const CallFault& fault) {
    std::vector<std::string> finished = {"000001", "000002", "000003"};
    long failed = 0;
    {
      Store store(state());
      (void)Arm(fault);
      try {
        finished.push_back(StoreScan(store, patient_, WriteCompared));
      } catch (const std::exception&) {  // told to the person, who scans again
      }
      failed = Disarm();
    }
    ExpectNothingLost(finished);
    return failed;
  });
}

TEST_F(FailingDiskTest, WhileAStoreStartsAfterACrash) {
  ForEachFault("starting", [&](const CallFault& fault) {
    (void)Arm(fault);
    try {
      StoreOptions options;
      options.lock_wait = std::chrono::milliseconds(0);
      Store store(state(), options);
    } catch (const IoError&) {  // safe mode
    }
    const long failed = Disarm();
    ExpectNothingLost({"000001", "000002", "000003"});
    return failed;
  });
}

TEST_F(FailingDiskTest, WhileABackupIsMade) {
  ForEachFault("backing up", [&](const CallFault& fault) {
    long failed = 0;
    {
      Store store(state());
      (void)Arm(fault);
      bool is_made = false;
      try {
        is_made = StoreBackup(store).Make(kAnna, backup()).problems.empty();
      } catch (const IoError&) {
      }
      failed = Disarm();
      EXPECT_TRUE(is_made || failed > 0);
      if (is_made) {
        EXPECT_EQ(RestoreBackup(backup(), folder_ / "restored").scans, 3U);
      }
      if (!is_made && fs::exists(backup())) {  // whole, with a problem that it tells
        EXPECT_NO_THROW((void)RestoreBackup(backup(), folder_ / "restored"));
      }
    }
    ExpectNothingLost({"000001", "000002", "000003"});
    return failed;
  });
}

/// Also by the folder's sync, the last call, when the request lies there already.
TEST_F(FailingDiskTest, AFactoryResetThatCouldNotBeNotedDoesNotTakePlace) {
  const fs::path request = state() / kFactoryResetFile;
  const std::string below = folder_.path().string();
  int num_refused = 0;
  for (const FailingCall call : {FailingCall::kWrite, FailingCall::kSync, FailingCall::kRename}) {
    for (long nth = 1; nth <= 2; ++nth) {
      Prepare();
      ASSERT_TRUE(Arm({call, nth, EIO, false, below.c_str()}));
      bool is_noted = true;
      try {
        RequestFactoryReset(state(), FactoryReset::kWipe, kAnna);
      } catch (const IoError&) {
        is_noted = false;
        ++num_refused;
      }
      (void)Disarm();
      EXPECT_EQ(fs::exists(request), is_noted) << kCallNames[static_cast<int>(call)] << " " << nth;
    }
  }
  EXPECT_EQ(num_refused, 4) << "one write, two syncs, one renaming";
}

/// The loop, which gives it a name, need not wait for the disk any more.
TEST_F(FailingDiskTest, ACopyOfABundleIsOnTheDiskWhenItIsDone) {
  const std::string below = folder_.path().string();
  WriteWholeFile(folder_ / "bundle", std::string(100'000, 'x'));
  const Descriptor file = OpenForReading(folder_ / "bundle");
  ASSERT_TRUE(Arm({FailingCall::kSync, 1, EIO, false, below.c_str()}));
  EXPECT_THROW((void)CopyBundle(file.get(), folder_ / "updates", 1 << 20), IoError);
  EXPECT_EQ(Disarm(), 1);
  EXPECT_TRUE(fs::is_empty(folder_ / "updates"));
}

TEST_F(FailingDiskTest, WhileABackupIsMadeInOneFile) {
  const fs::path archive = folder_ / "backup.tar";
  ForEachFault(
      "backing up into a file",
      [&](const CallFault& fault) {
        long failed = 0;
        {
          Store store(state());
          (void)Arm(fault);
          bool is_made = false;
          try {
            is_made = StoreBackup(store).Make(kAnna, archive).problems.empty();
          } catch (const IoError&) {
          }
          failed = Disarm();
          EXPECT_TRUE(is_made || failed > 0);
          if (is_made) {
            EXPECT_EQ(RestoreBackup(archive, folder_ / "restored").scans, 3U);
          } else if (fs::exists(archive)) {  // whole, with a problem that it tells
            EXPECT_NO_THROW((void)RestoreBackup(archive, folder_ / "restored"));
          }
          if (fault.call == FailingCall::kWrite) {  // such as a full disk
            for (const auto& entry : fs::directory_iterator(folder_.path()))
              EXPECT_FALSE(entry.path().filename().string().starts_with(".backup.tar"))
                  << entry.path();
          }
        }
        ExpectNothingLost({"000001", "000002", "000003"});
        return failed;
      },
      3);
}

TEST_F(FailingDiskTest, WhileABackupIsRestored) {
  const fs::path kept = folder_ / "kept";
  (void)BackUpStopped(prepared(), kept);
  ForEachFault(
      "restoring",
      [&](const CallFault& fault) {
        // What no backup has: it is replaced, but never lost.
        fs::create_directory(state() / "calibration");
        WriteWholeFile(state() / "calibration" / "unit.json", std::string_view("of before"));
        (void)Arm(fault);
        bool is_restored = false;
        try {
          (void)RestoreOver(kept, state());
          is_restored = true;
        } catch (const std::exception&) {  // of the state folder, or that the backup cannot be read
        }
        const long failed = Disarm();
        EXPECT_TRUE(is_restored || failed > 0);
        const auto holds_before = [&] {
          for (const auto& [path, content] : testing::FilesBelow(state()))
            if (path.ends_with("calibration/unit.json") && content == "of before") return true;
          return false;
        };
        EXPECT_TRUE(holds_before());
        bool opens = true;
        try {
          const Store store(state());
        } catch (const DatabaseCorrupt&) {  // safe mode, which asks to repeat the restore
          opens = false;
        }
        if (!opens) {
          EXPECT_FALSE(is_restored);
          EXPECT_NO_THROW((void)RestoreOver(kept, state()));
        }
        ExpectNothingLost({"000001", "000002", "000003"});
        EXPECT_TRUE(holds_before());
        return failed;
      },
      2);
}

// --- databases that are not what was written

/// One of the ways in which a disk or a person damages a file.
std::string Damaged(std::string bytes, std::mt19937& random) {
  const auto at = [&](std::size_t size) {
    return std::uniform_int_distribution<std::size_t>(0, size - 1)(random);
  };
  constexpr std::size_t kPage = 4096;
  const auto page = [&] { return at(bytes.size() / kPage) * kPage; };
  switch (at(6)) {
    case 0:  // bits
      for (std::size_t n = 1 + at(8); n > 0; --n)
        bytes[at(bytes.size())] ^= static_cast<char>(1 << at(8));
      break;
    case 1:  // a page of zeros
      bytes.replace(page(), kPage, kPage, '\0');
      break;
    case 2: {  // two pages in each other's place
      const std::size_t a = page(), b = page();
      const std::string kept = bytes.substr(a, kPage);
      bytes.replace(a, kPage, bytes.substr(b, kPage));
      bytes.replace(b, kPage, kept);
      break;
    }
    case 3:  // cut off
      bytes.resize(at(bytes.size()));
      break;
    case 4: {  // noise
      const std::size_t begin = at(bytes.size());
      for (std::size_t i = begin; i < std::min(bytes.size(), begin + 1 + at(600)); ++i)
        bytes[i] = static_cast<char>(at(256));
      break;
    }
    default:  // of the text, such as the tables' own statements and JSON
      for (std::size_t i = at(bytes.size()); i < bytes.size(); ++i) {
        if (bytes[i] < 'a' || bytes[i] > 'z') continue;
        bytes[i] = static_cast<char>(0x80 + at(128));
        break;
      }
  }
  return bytes;
}

TEST(DamagedDatabaseTest, IsOpenedOrRefusedAndNoScanIsDeleted) {
  const testing::TempFolder folder;
  const fs::path state = folder / "state";
  {
    Store store(state);
    const std::string patient = store.patients.Add(kAnna, "P", "thorax");
    const std::string scan = StoreScan(store, patient);
    (void)PlanAndApprove(store, store.references.Add(kAnna, scan, "", {}));
    (void)StoreScan(store, patient);
    store.settings.Change(kAnna, {});
    for (int i = 0; i < 50; ++i) store.audit.Log(kAnna, "note", "", std::string(100, 'n'));
  }
  const auto bytes = ReadWholeFile(state / "plumb.db", std::size_t{1} << 26);
  const std::string whole(bytes.begin(), bytes.end());
  const auto files = testing::FilesBelow(state / "scans");
  std::mt19937 random(20);
  int opened = 0, refused = 0, unreadable = 0;
  for (int round = 0; round < 200 * Repeats(); ++round) {
    SCOPED_TRACE(round);
    for (const char* name :
         {"plumb.db", "plumb.db-wal", "plumb.db-shm", "plumb.db-mark", "plumb.db-seals"})
      fs::remove(state / name);
    WriteWholeFile(state / "plumb.db", Damaged(whole, random));
    try {
      Store store(state);
      ++opened;
      try {
        for (const Patient& patient : store.patients.List()) {
          (void)store.references.List(patient.id);
          (void)store.scans.List(patient.id, 100);
          (void)store.references.Approved(patient.id);
        }
        (void)store.settings.Get();
        (void)store.audit.Find({0, 100});
        (void)store.audit.FirstBroken();
      } catch (const std::exception&) {  // of one record, said so
        ++unreadable;
      }
    } catch (const IoError&) {  // safe mode
      ++refused;
    }
    auto kept = testing::FilesBelow(state / "scans");
    for (auto& [name, content] : testing::FilesBelow(state / "set-aside")) {
      const std::size_t slash = name.find('/');  // "000001-2/scene/..." was scan 000001's
      kept[name.substr(0, 6) + name.substr(slash)] = content;
    }
    EXPECT_EQ(kept, files);
    if (fs::exists(state / "set-aside")) {  // back for the next round
      for (const auto& entry : fs::directory_iterator(state / "set-aside"))
        fs::rename(entry.path(), state / "scans" / entry.path().filename().string().substr(0, 6));
    }
    if (::testing::Test::HasFailure()) return;
  }
  fmt::print("{} databases opened ({} with a record that cannot be read), {} refused\n", opened,
             unreadable, refused);
  EXPECT_EQ(unreadable, 0) << "each page has a checksum, which is compared before a row is read";
  EXPECT_GT(refused, 0);
}

}  // namespace
}  // namespace plumb
