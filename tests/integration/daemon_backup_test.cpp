// SPDX-License-Identifier: Apache-2.0
// A backup of many scans while a real plumbd scans: the sweep is not disturbed, and what is
// restored is what was stored.
#include <atomic>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/archive/backup.hpp"
#include "daemon/records/store.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/result_with.hpp"
#include "tests/support/sanitized.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::Plumbd;

constexpr int kScans = 200;
constexpr double kMostDropped = 0.01;

TEST(DaemonBackupTest, ABackupOf200ScansDisturbsNoSweepAndIsRestoredByteIdentical) {
  testing::RenderOnce();
  const testing::TempFolder folder;
  const fs::path state = folder / "state", backup = folder / "backup";
  {
    Store store(state);
    const std::string patient = store.patients.Add(testing::kAnna, "P", "thorax");
    for (int i = 0; i < kScans; ++i) {
      const std::string id = store.scans.Begin(testing::Begun(patient));
      testing::FillScan(store.folders.Staging(id));
      WriteWholeFile(store.folders.Staging(id) / "scene" / "cloud.ply",
                     std::string(std::size_t{200} << 10, static_cast<char>('a' + i % 26)) + id);
      store.scans.Finish(id, {.outcome = ScanOutcome::kDone,
                              .result_json = testing::ResultWith(R"({"verdict":"in_tolerance"})"),
                              .swept_area_m2 = 1.0});
    }
  }
  const auto stored = testing::FilesBelow(state / "scans");
  ASSERT_EQ(stored.size(), kScans * std::size(testing::kScanFiles));

  Plumbd plumbd(folder.path(), {.state = state});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  std::atomic<int> made = 0;
  std::atomic<bool> begun = false;
  std::jthread backing_up([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {  // one after the other: no part of the sweep is without
      begun = true;
      const auto answer =
          plumb::Run({PLUMB_BINARY, "--control", plumbd.socket(), "backup", backup});
      ASSERT_EQ(answer.exit_code, 0) << answer.err;
      ++made;
    }
  });
  while (!begun) std::this_thread::yield();
  const json status = plumbd.ScanOnce();
  const int made_meanwhile = made;
  backing_up.request_stop();
  backing_up.join();
  const int frames = status["last_result"]["frames"],
            lost = status["last_result"]["frames_dropped"];
  std::printf("%d frames, %d dropped, %d backups of %d scans meanwhile\n", frames, lost,
              made_meanwhile, kScans);
  EXPECT_GE(made, 1);
  if (!testing::kIsSanitized) {
    EXPECT_LE(lost, kMostDropped * (frames + lost));
  }

  const auto last = plumb::Run({PLUMB_BINARY, "--control", plumbd.socket(), "backup", backup});
  EXPECT_EQ(last.exit_code, 0) << last.err;
  const fs::path archive = folder / "backup.tar";
  const auto packed = plumb::Run({PLUMB_BINARY, "--control", plumbd.socket(), "backup", archive});
  EXPECT_EQ(packed.exit_code, 0) << packed.err;
  ASSERT_EQ(plumbd.Stop(), 0);
  const BackupReport report = RestoreBackup(backup, folder / "restored");
  EXPECT_EQ(report.scans, kScans + 1U);
  const auto restored = testing::FilesBelow(folder / "restored" / "scans");
  EXPECT_TRUE(restored == testing::FilesBelow(state / "scans"));
  const auto unpacked =
      plumb::Run({PLUMB_BINARY, "restore", archive, "--state", folder / "restored-from-archive"});
  EXPECT_EQ(unpacked.exit_code, 0) << unpacked.err;
  EXPECT_TRUE(testing::FilesBelow(folder / "restored-from-archive" / "scans") == restored);
  for (const auto& [name, content] : stored)
    EXPECT_TRUE(restored.contains(name) && restored.at(name) == content) << name;
}

}  // namespace
}  // namespace plumb
