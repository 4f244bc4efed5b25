// SPDX-License-Identifier: Apache-2.0
// One flipped bit in any file of a state folder changes nothing that a verdict rests on: it is
// without effect, or refused with its cause.
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/database/rows_of.hpp"
#include "tests/unit/records/scan_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::FilesBelow;
using testing::kAnna;

enum class Effect { kNone, kRefused, kSilent };

class FlippedFilesTest : public ::testing::Test {
 protected:
  FlippedFilesTest() {
    Store store(state());
    store.users.Add(
        kAnna, {.name = "eva", .role = Role::kPhysicist, .password_hash = "x", .created_at = {}});
    const std::string patient = store.patients.Add(kAnna, "P", "thorax");
    for (int i = 0; i < 2; ++i) scans_.push_back(testing::StoreScan(store, patient));
    (void)testing::PlanAndApprove(store, store.references.Add(kAnna, scans_[0], "first", {}));
    store.settings.Change(kAnna, store.settings.Get());
    rows_ = Rows(store);
    next_scan_ = LastNumber(store);
  }
  void SetUp() override { files_ = FilesBelow(state()); }
  [[nodiscard]] fs::path state() const { return folder_ / "state"; }

  /// Without what a start or a check writes itself.
  static std::string Rows(Store& store) {
    return testing::RowsOf(*store.database().ForLists(),
                           {"audit", "sqlite_sequence", "checked_at", "unavailable"});
  }
  static std::int64_t LastNumber(Store& store) {
    return store.database()
        .ForLists()
        ->FirstInteger("SELECT seq FROM sqlite_sequence WHERE name = 'scans'")
        .value_or(0);
  }

  /// What the flipped files do to a start, to the page and to a comparison.
  [[nodiscard]] Effect EffectIn(const fs::path& damaged) const try {
    Store store(damaged);
    if (Rows(store) != rows_ || LastNumber(store) < next_scan_) return Effect::kSilent;
    const auto found = FilesBelow(damaged);
    bool is_refused = !store.references.Approved("1");
    for (const std::string& scan : scans_) {
      const std::optional<Scan> shown = store.scans.Find(scan);
      if (!shown || !shown->result || shown->folder.empty()) {
        is_refused = true;
        continue;
      }
      if (!store.integrity.Check(scan, /*scene_only=*/true).empty()) {
        is_refused = true;
        continue;
      }
      const std::string scene = "scans/" + scan + "/scene/";
      for (const auto& [path, bytes] : files_)
        if (path.starts_with(scene) && found.at(path) != bytes) return Effect::kSilent;
    }
    return is_refused ? Effect::kRefused : Effect::kNone;
  } catch (const IoError&) {
    return Effect::kRefused;
  } catch (const DataError&) {
    return Effect::kRefused;
  }

  testing::TempFolder folder_;
  std::vector<std::string> scans_;
  std::string rows_;
  std::int64_t next_scan_ = 0;
  std::map<std::string, std::string> files_;
};

TEST_F(FlippedFilesTest, NoBitOfAnyFileTurnsWhatIsDecidedByIt) {
  constexpr int kSample = 70;
  const char* const repeats = std::getenv("PLUMB_FAULT_REPEATS");
  const int rounds = kSample * (repeats == nullptr ? 1 : std::max(1, std::atoi(repeats)));
  std::mt19937 random(18);
  std::vector<std::string> paths;
  for (const auto& [path, bytes] : files_)
    if (!bytes.empty()) paths.push_back(path);
  ASSERT_GT(paths.size(), 2 * std::size(testing::kScanFiles));
  std::map<Effect, int> num;
  for (int round = 0; round < rounds; ++round) {
    const fs::path damaged = folder_ / "damaged";
    fs::remove_all(damaged);
    fs::copy(state(), damaged, fs::copy_options::recursive);
    const std::string& path = paths[random() % paths.size()];
    std::string bytes = files_.at(path);
    const std::size_t at = random() % bytes.size();
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8));
    WriteWholeFile(damaged / path, std::string_view(bytes));
    const Effect effect = EffectIn(damaged);
    ++num[effect];
    EXPECT_NE(effect, Effect::kSilent) << path << ", byte " << at;
  }
  std::cout << fmt::format("{} flips in {} files: {} without effect, {} refused, {} silent\n",
                           rounds, paths.size(), num[Effect::kNone], num[Effect::kRefused],
                           num[Effect::kSilent]);
  EXPECT_GT(num[Effect::kRefused], 0);
  EXPECT_GT(num[Effect::kNone], 0);
}

}  // namespace
}  // namespace plumb
