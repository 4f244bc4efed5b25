// SPDX-License-Identifier: Apache-2.0
// Bundles through RAUC itself, on a bus and a machine made of files. plumbd's part runs as the user
// nobody, without rights, as plumbd does: it cannot read files any more once RAUC owns them.
#include <signal.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/update/updater.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/skip.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/support/updater_on_loop.hpp"

extern char** environ;

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::TempFolder;

constexpr uid_t kNobody = 65534;

class Child {
 public:
  Child() = default;
  explicit Child(std::vector<std::string> command) {
    std::vector<char*> arguments;
    for (std::string& word : command) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawnattr_t attributes;
    ::posix_spawnattr_init(&attributes);
    sigset_t none;
    sigemptyset(&none);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
    if (::posix_spawnp(&pid_, arguments[0], nullptr, &attributes, arguments.data(), environ) != 0)
      pid_ = -1;
    ::posix_spawnattr_destroy(&attributes);
  }
  ~Child() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  [[nodiscard]] int Wait() {
    int status = -1;
    if (pid_ > 0) ::waitpid(std::exchange(pid_, -1), &status, 0);
    return status;
  }

 private:
  pid_t pid_ = -1;
};

std::string Bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

bool HasRauc() { return ::access("/usr/bin/rauc", X_OK) == 0; }

std::string WhyNotPermitted() {
  if (::geteuid() != 0) return "needs root: RAUC mounts bundles and takes them over";
  if (::access("/dev/loop-control", W_OK) != 0) return "no loop devices here, RAUC needs one";
  return {};
}

class RaucTest : public testing::UpdaterOnLoop {
 protected:
  static void SetUpTestSuite() {
    if (!HasRauc() || !WhyNotPermitted().empty()) return;
    made_ = std::make_unique<TempFolder>();
    const std::string log = (*made_ / "made").string();
    Child make({"/bin/sh", "-c",
                std::string(PLUMB_SOURCE_DIR) + "/tests/update/make_bundles.sh " +
                    made_->path().string() + " >" + log + " 2>&1"});
    ASSERT_EQ(make.Wait(), 0) << Bytes(log);
    fs::permissions(made_->path(), fs::perms(0755));  // user "nobody" reads the slots
  }
  static void TearDownTestSuite() { made_.reset(); }

  void SetUp() override {
    if (!HasRauc()) PLUMB_SKIP("rauc is missing: run toolchain/install");
    if (const std::string why = WhyNotPermitted(); !why.empty()) GTEST_SKIP() << why;
    fs::create_directories(folder_ / "updates");
    for (const fs::path& path : {folder_.path(), folder_ / "updates"})
      ASSERT_EQ(::chown(path.c_str(), kNobody, kNobody), 0);
    for (const char* name : {"a.img", "b.img"})
      std::ofstream(*made_ / "slots" / name, std::ios::binary) << std::string(2'000'000, '\0');
    for (const char* name : {"primary", "state.A", "state.B", "status"})
      fs::remove(*made_ / "state" / name);
    fs::copy_file(*made_ / "pki" / "own-ca.pem", *made_ / "keyring.pem",
                  fs::copy_options::overwrite_existing);
    bus_ = std::make_unique<testing::PrivateBus>(folder_.path());
    ::setenv("DBUS_SYSTEM_BUS_ADDRESS", bus_->address().c_str(), 1);
    ::setenv("DBUS_STARTER_BUS_TYPE", "system", 1);
    StartRauc("A");
    ASSERT_EQ(::seteuid(kNobody), 0);
  }
  void TearDown() override {
    if (::geteuid() == kNobody) {
      ASSERT_EQ(::seteuid(0), 0);
    }
  }

  void StartRauc(const std::string& slot) {
    rauc_ = std::make_unique<Child>(
        std::vector<std::string>{"rauc", "--conf=" + (*made_ / "system.conf").string(), "service",
                                 "--override-boot-slot=" + slot});
  }

  /// As the machine's start does: plumbd and RAUC are those of this slot, and so is the keyring.
  void RestartFrom(const std::string& slot, const std::string& image) {
    On([this] { updater_.reset(); });
    ASSERT_EQ(::seteuid(0), 0);
    rauc_.reset();
    const fs::path keyring = *made_ / "keyring.pem";
    fs::remove(keyring);
    Child dump({"/sbin/debugfs", "-R", "dump /etc/rauc/ca.pem " + keyring.string(),
                (*made_ / "slots" / image).string()});
    ASSERT_EQ(dump.Wait(), 0);
    ASSERT_TRUE(fs::exists(keyring)) << "the slot holds no system with a keyring";
    StartRauc(slot);
    ASSERT_EQ(::seteuid(kNobody), 0);
    MakeUpdater();
    ASSERT_TRUE(Becomes([&] { return StatusNow().supported; })) << "RAUC does not answer";
    ASSERT_EQ(StatusNow().slot, slot);
  }

  /// Puts a bundle where an upload would.
  void Take(const std::string& name) {
    ASSERT_EQ(::seteuid(0), 0);
    const fs::path to = folder_ / "updates" / (name + ".raucb");
    fs::copy_file(*made_ / (name + ".raucb"), to, fs::copy_options::overwrite_existing);
    ASSERT_EQ(::chown(to.c_str(), kNobody, kNobody), 0);
    ASSERT_EQ(::chmod(to.c_str(), 0600), 0);  // as plumbd's unit has it (UMask=)
    ASSERT_EQ(::seteuid(kNobody), 0);
  }

  void MakeUpdater() {
    On([this] {
      updater_ = std::make_unique<Updater>(
          loop_, UpdaterOptions{.folder = folder_ / "updates",
                                .max_bytes = 100 << 20,
                                .bus_address = bus_->address(),
                                .version = "1.0.0",
                                .blocking_reason = {},
                                .changed = {},
                                .run_in_background = {},
                                .ended = [this](const std::string&, const Message& failure) {
                                  ++num_ended_;
                                  failure_ = failure.English();
                                }});
    });
  }
  void Play(const std::function<void()>& test) {
    RunBesideLoop([&] {
      MakeUpdater();
      if (Becomes([&] { return StatusNow().supported; })) {
        test();
      } else {
        ADD_FAILURE() << "RAUC does not answer";
      }
    });
  }
  /// Also waits for its end. Gives why it failed, or nothing.
  std::string InstallToTheEnd(const std::string& name) {
    const int before = num_ended_;
    const Change change = Install(name + ".raucb");
    if (change.result != ChangeResult::kDone) return change.message.English();
    if (!Becomes([&] { return num_ended_ > before; })) return "it does not end";
    return failure_;
  }
  [[nodiscard]] static bool SlotHolds(const std::string& slot, const std::string& image) {
    return Bytes(*made_ / "slots" / (slot + ".img")).starts_with(Bytes(*made_ / (image + ".img")));
  }
  [[nodiscard]] static bool IsUntouched() {
    return Bytes(*made_ / "slots" / "b.img") == std::string(2'000'000, '\0') &&
           Bytes(*made_ / "slots" / "a.img") == std::string(2'000'000, '\0');
  }
  void ExpectRefusal(const std::string& bundle, const ::testing::Matcher<std::string>& why) {
    Take(bundle);
    EXPECT_THAT(InstallToTheEnd(bundle), why) << bundle;
    EXPECT_FALSE(StatusNow().installing);
    EXPECT_TRUE(IsUntouched()) << bundle;
  }

  static inline std::unique_ptr<TempFolder> made_;
  TempFolder folder_;
  std::unique_ptr<testing::PrivateBus> bus_;
  std::unique_ptr<Child> rauc_;
  std::atomic<int> num_ended_{0};
  std::string failure_;
};

TEST_F(RaucTest, AGoodBundleFillsTheOtherSlotAndIsStartedNext) {
  Take("good");
  Play([&] {
    EXPECT_EQ(StatusNow().slot, "A");
    EXPECT_EQ(InstallToTheEnd("good"), "");
    EXPECT_TRUE(SlotHolds("b", "good"));
    EXPECT_FALSE(SlotHolds("a", "good"));
    EXPECT_EQ(Bytes(*made_ / "state" / "primary"), "B\n");
    EXPECT_THAT(StatusNow().message.English(), HasSubstr("restart the appliance to use it"));
    EXPECT_EQ(StatusNow().fraction, 1.0);
  });
}

TEST_F(RaucTest, EachBadBundleIsRefusedWithItsOwnSentence) {
  Play([&] {
    ExpectRefusal("older", HasSubstr("holds version 0.0.9, older than 1.0.0 which runs"));
    ExpectRefusal("other", HasSubstr("is for another machine: it is for 'plumb-other-machine', "
                                     "this is 'plumb-test'"));
    ExpectRefusal("stranger", HasSubstr("not signed by a key that this machine trusts"));
    ExpectRefusal("strangers-verity", HasSubstr("not signed by a key that this machine trusts"));
    ExpectRefusal("damaged", HasSubstr("was damaged on its way"));
    ExpectRefusal("damaged-verity", HasSubstr("was damaged on its way"));
    ExpectRefusal("truncated", HasSubstr("is not a complete bundle"));
  });
}

/// RAUC makes root the owner of what it has looked at.
TEST_F(RaucTest, ASecondAttemptOnABundleThatRaucHasTakenOverWorks) {
  Take("good");
  Play([&] {
    EXPECT_EQ(InstallToTheEnd("good"), "");
    EXPECT_NE(::eaccess((folder_ / "updates" / "good.raucb").c_str(), R_OK), 0)
        << "RAUC did not take it over: this test shows nothing";
    ASSERT_EQ(::seteuid(0), 0);
    std::ofstream(*made_ / "slots" / "b.img", std::ios::binary) << std::string(2'000'000, '\0');
    ASSERT_EQ(::seteuid(kNobody), 0);
    EXPECT_EQ(InstallToTheEnd("good"), "");
    EXPECT_TRUE(SlotHolds("b", "good"));
  });
}

TEST_F(RaucTest, ASecondAttemptOnARefusedBundleGivesTheSameReason) {
  Play([&] {
    ExpectRefusal("stranger", HasSubstr("not signed by a key that this machine trusts"));
    EXPECT_THAT(InstallToTheEnd("stranger"), HasSubstr("not signed by a key that this machine"));
    // Sent again, it is another file.
    Take("good");
    ASSERT_EQ(::rename((folder_ / "updates" / "good.raucb").c_str(),
                       (folder_ / "updates" / ".upload-1").c_str()),
              0);
    const Change change = Add(folder_ / "updates" / ".upload-1", "stranger.raucb");
    EXPECT_EQ(change.result, ChangeResult::kDone) << change.message.English();
    EXPECT_EQ(InstallToTheEnd("stranger"), "");
    EXPECT_TRUE(SlotHolds("b", "good"));
  });
}

TEST_F(RaucTest, ABundleCanBeRemovedAfterRaucHasTakenItOver) {
  Take("good");
  Play([&] {
    EXPECT_EQ(InstallToTheEnd("good"), "");
    Change change;
    On([&] { change = updater_->Remove("good.raucb"); });
    EXPECT_EQ(change.result, ChangeResult::kDone) << change.message.English();
    EXPECT_TRUE(StatusNow().bundles.empty());
  });
}

/// The new authority comes with an update that the old one signed, and for a time both may sign;
/// the update that ends this time is signed by the new one already.
TEST_F(RaucTest, AnotherAuthorityTakesOverByWayOfAnUpdate) {
  const auto stranger = HasSubstr("not signed by a key that this machine trusts");
  Play([&] {
    ExpectRefusal("next", stranger);
    Take("both-keys");
    ASSERT_EQ(InstallToTheEnd("both-keys"), "");
    RestartFrom("B", "b.img");

    for (const char* name : {"good", "next"}) {
      Take(name);
      EXPECT_EQ(InstallToTheEnd(name), "") << "while both may sign";
      EXPECT_TRUE(SlotHolds("a", name));
    }
    Take("stranger");
    EXPECT_THAT(InstallToTheEnd("stranger"), stranger);
    Take("new-key");
    ASSERT_EQ(InstallToTheEnd("new-key"), "");
    RestartFrom("A", "a.img");

    Take("good");
    EXPECT_THAT(InstallToTheEnd("good"), stranger) << "the old authority's time is over";
    EXPECT_TRUE(SlotHolds("b", "both-keys"));
    Take("next");
    EXPECT_EQ(InstallToTheEnd("next"), "");
    EXPECT_TRUE(SlotHolds("b", "next"));
  });
}

}  // namespace
}  // namespace plumb

/// A failure counts more than a test that was left out.
int main(int argc, char** argv) {
  ::testing::InitGoogleMock(&argc, argv);
  const int code = RUN_ALL_TESTS();
  constexpr int kLeftOut = 77;
  return code == 0 && ::testing::UnitTest::GetInstance()->skipped_test_count() > 0 ? kLeftOut
                                                                                   : code;
}
