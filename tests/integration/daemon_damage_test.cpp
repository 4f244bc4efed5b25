// SPDX-License-Identifier: Apache-2.0
// State folders that a disk, a person or another program has damaged, under a real plumbd: it
// starts each time, its page says what is wrong, and nothing that it does not understand is
// deleted.
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <map>
#include <random>
#include <set>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "drivers/files/file_io.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::HttpAnswer;
using test::HttpClient;
using test::kPassword;
using testing::Plumbd;

// PLUMB_DAMAGED_STATES asks for more rounds.
int Rounds() {
  const char* asked = std::getenv("PLUMB_DAMAGED_STATES");
  return asked != nullptr ? std::max(1, std::atoi(asked)) : 12;
}

std::vector<fs::path> FilesBelow(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(fs::relative(entry.path(), folder));
  std::sort(files.begin(), files.end());
  return files;
}

class Damage {
 public:
  explicit Damage(unsigned seed) : random_(seed) {}

  /// Damages one file below the folder; says what it did, and to which.
  std::pair<std::string, fs::path> Do(const fs::path& state) {
    // Half of the rounds meet the database, which everything else hangs on.
    std::vector<fs::path> files = FilesBelow(state);
    return Do(state, Below(2) == 0 ? fs::path("plumb.db") : files[Below(files.size())]);
  }

  std::pair<std::string, fs::path> Do(const fs::path& state, const fs::path& file) {
    static constexpr const char* kWays[] = {"flipped bytes", "shortened",     "emptied",
                                            "zeroed a page", "swapped pages", "made a folder",
                                            "removed",       "dangling link", "text instead"};
    const std::size_t way = Below(std::size(kWays));
    Apply(way, state / file);
    return {fmt::format("{}: {}", kWays[way], file.string()), file};
  }

 private:
  static constexpr std::size_t kPage = 4096;

  std::size_t Below(std::size_t n) { return random_() % n; }

  void Apply(std::size_t way, const fs::path& file) {
    if (way >= 5 && way <= 7) {
      fs::remove(file);
      if (way == 5) fs::create_directory(file);
      if (way == 7) fs::create_symlink("/nonexistent/disk", file);
      return;
    }
    std::string bytes = "what once was a file\n";
    if (way != 8) {
      const std::vector<std::uint8_t> read = ReadWholeFile(file, 1 << 30);
      bytes.assign(read.begin(), read.end());
    }
    if (way == 0)
      for (int i = 0; i < 8 && !bytes.empty(); ++i) bytes[Below(bytes.size())] ^= 0x55;
    if (way == 1) bytes.resize(bytes.size() / 2);
    if (way == 2) bytes.clear();
    const std::size_t pages = bytes.size() / kPage;
    if (way == 3 && pages > 0) bytes.replace(kPage * Below(pages), kPage, kPage, '\0');
    if (way == 4 && pages > 1) {
      const std::size_t a = kPage * Below(pages), b = kPage * Below(pages);
      std::swap_ranges(bytes.begin() + static_cast<std::ptrdiff_t>(a),
                       bytes.begin() + static_cast<std::ptrdiff_t>(a + kPage),
                       bytes.begin() + static_cast<std::ptrdiff_t>(b));
    }
    std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
  }

  std::mt19937 random_;
};

class DaemonDamageTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  // A reference with its files, an account, a certificate: what a working appliance has.
  void MakeState(const fs::path& folder) {
    fs::create_directories(folder);
    Plumbd plumbd(folder);
    ASSERT_TRUE(plumbd.WaitUntilUp()) << plumbd.log();
    plumbd.WaitForState("ready");
    (void)plumbd.MakeFirstAccount();
    plumbd.ScanOnce();
    ASSERT_EQ(plumbd.Stop(), 0);
  }

  testing::TempFolder folder_;
};

TEST_F(DaemonDamageTest, StartsFromEveryDamagedStateSaysWhatIsWrongAndDeletesNothing) {
  MakeState(folder_ / "whole");
  const fs::path whole = folder_ / "whole" / "state";
  const std::vector<fs::path> scan_files = FilesBelow(whole / "scans");
  ASSERT_FALSE(scan_files.empty());
  std::map<std::string, int> outcomes;
  int lost = 0;
  for (int round = 0; round < Rounds(); ++round) {
    const fs::path here = folder_ / "damaged";
    fs::remove_all(here);
    fs::create_directories(here);
    fs::copy(whole, here / "state", fs::copy_options::recursive);
    const auto [what, damaged] = Damage(static_cast<unsigned>(round)).Do(here / "state");
    SCOPED_TRACE(fmt::format("round {}, {}", round, what));
    // A start looks at types and sizes; other damage to scans is met by the check of their content.
    const bool is_noticed =
        !fs::is_regular_file(fs::symlink_status(here / "state" / damaged)) ||
        fs::file_size(here / "state" / damaged) != fs::file_size(whole / damaged);

    Plumbd plumbd(here);
    ASSERT_TRUE(plumbd.WaitUntilUp()) << plumbd.log();
    HttpClient client(plumbd.port());
    EXPECT_EQ(client.Get("/").status, 200);
    const HttpAnswer health = client.Get("/health");
    EXPECT_THAT(health.status, ::testing::AnyOf(200, 503));
    EXPECT_FALSE(health.json().is_discarded()) << health.body;
    const json status = plumbd.Status();
    // Who opens the page reads the reason: without logging in where no account can be looked up.
    const json session = client.Get("/api/v1/session").json();
    const bool has_accounts = fs::exists(here / "state" / "plumb.db") && damaged != "plumb.db";
    if (has_accounts) {
      EXPECT_EQ(session["setup_required"], false) << session.dump();
    }
    if (health.status == 503) {
      EXPECT_FALSE(status.value("reason", "").empty()) << status.dump();
      EXPECT_EQ(session["setup_required"], false) << "no first account can be created in safe mode";
      if (session["fault"] == "") {
        EXPECT_EQ(client.LogIn("engineer", kPassword), 200) << session.dump();
        EXPECT_NE(client.Get("/api/v1/status").json()["fault"], nullptr);
      }
    } else {
      EXPECT_EQ(session["fault"], "");
    }
    if (is_noticed && damaged == "plumb.db") {
      EXPECT_EQ(health.status, 503);
    }
    if (is_noticed && damaged.string().starts_with("scans/")) {
      plumbd.WaitFor("a warning of the damaged scan", [](const json& now) {
        return now["warnings"].dump().find("are missing or changed") != std::string::npos;
      });
    }
    ++outcomes[health.status == 200 ? "works" : "says what is wrong"];
    EXPECT_EQ(plumbd.Stop(), 0) << plumbd.log();

    std::multiset<std::string> kept;
    for (const fs::path& file : FilesBelow(here / "state")) kept.insert(file.filename());
    for (const fs::path& file : scan_files) {
      if (fs::path("scans") / file == damaged) continue;
      if (!kept.contains(file.filename())) {
        ++lost;
        ADD_FAILURE() << "scans/" << file << " is gone\n" << plumbd.log();
      }
    }
    if (::testing::Test::HasFatalFailure()) return;
  }
  fmt::print(
      "{} damaged states: {} start and work, {} start and say what is wrong, {} files lost\n",
      Rounds(), outcomes["works"], outcomes["says what is wrong"], lost);
}

/// Gives the state folder of one that was killed; rows of five patients stand in its log of writes
/// alone.
fs::path MakeKilledState(const fs::path& folder) {
  fs::create_directories(folder);
  {  // Whoever ends in order empties the log of writes; one that runs does so once a minute.
    Plumbd plumbd(folder);
    EXPECT_TRUE(plumbd.WaitUntilUp()) << plumbd.log();
    HttpClient engineer = plumbd.MakeFirstAccount();
    EXPECT_EQ(engineer.LogIn("engineer", kPassword), 200);
    EXPECT_TRUE(test::AddAccount(plumbd.port(), engineer, "tom", "technician"));
    EXPECT_EQ(plumbd.Stop(), 0) << plumbd.log();
    const fs::path log = plumbd.state() / "plumb.db-wal";
    EXPECT_TRUE(!fs::exists(log) || fs::file_size(log) == 0);
  }
  Plumbd plumbd(folder);
  EXPECT_TRUE(plumbd.WaitUntilUp()) << plumbd.log();
  HttpClient tom(plumbd.port());
  EXPECT_EQ(tom.LogIn("tom", kPassword), 200);
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(tom.Post("/api/v1/patients", {{"code", fmt::format("K{}", i)}, {"site", ""}}).status,
              201);
  plumbd.Signal(SIGKILL);
  EXPECT_EQ(plumbd.Wait(), -SIGKILL);
  EXPECT_GT(fs::file_size(plumbd.state() / "plumb.db-wal"), 0U);
  return plumbd.state();
}

TEST_F(DaemonDamageTest, NoDamageToTheLogOfWritesTakesARowSilently) {
  const fs::path whole = MakeKilledState(folder_ / "whole");
  const int rounds = (Rounds() + 1) / 2;
  int refused = 0;
  for (int round = 0; round < rounds; ++round) {
    const fs::path here = folder_ / "damaged", log = here / "state" / "plumb.db-wal";
    fs::remove_all(here);
    fs::create_directories(here);
    fs::copy(whole, here / "state", fs::copy_options::recursive);
    const std::string what =
        Damage(static_cast<unsigned>(round)).Do(here / "state", "plumb.db-wal").first;
    SCOPED_TRACE(fmt::format("round {}, {}", round, what));
    const auto bytes = [&] {
      return fs::is_regular_file(log) ? ReadWholeFile(log, 1 << 30) : std::vector<std::uint8_t>();
    };
    const std::vector<std::uint8_t> damaged = bytes();
    Plumbd plumbd(here);
    ASSERT_TRUE(plumbd.WaitUntilUp()) << plumbd.log();
    HttpClient tom(plumbd.port());
    EXPECT_EQ(tom.Get("/api/v1/session").json()["setup_required"], false);
    if (tom.Get("/health").status == 200) {
      ASSERT_EQ(tom.LogIn("tom", kPassword), 200);
      const std::string codes = tom.Get("/api/v1/patients").body;
      for (int i = 0; i < 5; ++i)
        EXPECT_THAT(codes, ::testing::HasSubstr(fmt::format("\"K{}\"", i)));
    } else {
      ++refused;
      EXPECT_NE(plumbd.Status().value("reason", ""), "");
      EXPECT_EQ(bytes(), damaged) << "it is evidence, and may be repaired";
    }
    EXPECT_EQ(plumbd.Stop(), 0) << plumbd.log();
  }
  EXPECT_GT(refused, 0);
  fmt::print("{} damaged logs of writes: {} refused, no row lost silently\n", rounds, refused);
}

}  // namespace
}  // namespace plumb
