// Updates through a RAUC of our own making on a bus of our own.
#include "daemon/update/updater.hpp"
#include "daemon/update/bundle_check.hpp"

#include <systemd/sd-bus.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <future>
#include <mutex>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/private_bus.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::PrivateBus;
using testing::TempFolder;
using web::ChangeResult;

/// As much of RAUC 1.8 as the updater speaks with: names, signatures and order of signals are
/// RAUC's.
class FakeRauc {
 public:
  std::atomic<bool> refuses_signature{false};
  std::atomic<bool> fails{false};
  std::string version = "9.0", slot = "A";
  std::atomic<int> first_percent{40};
  std::atomic<const char*> first_step{"Copying image to rootfs.1"};

  explicit FakeRauc(const std::string& address) {
    sd_bus_new(&bus_);
    sd_bus_set_address(bus_, address.c_str());
    sd_bus_set_bus_client(bus_, 1);
    sd_bus_start(bus_);
    sd_bus_add_object_vtable(bus_, nullptr, "/", "de.pengutronix.rauc.Installer", kTable, this);
    sd_bus_request_name(bus_, "de.pengutronix.rauc", 0);
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (sd_bus_process(bus_, nullptr) == 0) sd_bus_wait(bus_, 20000);
        if (const int percent = reach_.exchange(-1); percent >= 0) {
          percent_ = percent;
          sd_bus_emit_properties_changed(bus_, "/", "de.pengutronix.rauc.Installer", "Progress",
                                         nullptr);
        }
        if (release_.exchange(false)) Finish();
      }
    });
  }
  ~FakeRauc() {
    thread_.request_stop();
    thread_.join();
    sd_bus_flush_close_unref(bus_);
  }
  /// The installation that waits goes on to its end.
  void Release() { release_ = true; }
  /// The installation that waits comes so far.
  void Reach(int percent) { reach_ = percent; }
  [[nodiscard]] std::string installed() const {
    const std::lock_guard lock(mutex_);
    return installed_;
  }

 private:
  static int Info(sd_bus_message* message, void* self, sd_bus_error* error) {
    auto* rauc = static_cast<FakeRauc*>(self);
    if (rauc->refuses_signature)
      return sd_bus_error_set(error, "org.gtk.GDBus.UnmappedGError.Quark._r_2dbundle",
                              "signature verification failed");
    rauc->Report(0, "Checking bundle");
    rauc->Report(100, "Checking bundle done.");
    return sd_bus_reply_method_return(message, "ss", "plumb-amd64", rauc->version.c_str());
  }
  static int Install(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* rauc = static_cast<FakeRauc*>(self);
    const char* path = nullptr;
    sd_bus_message_read(message, "s", &path);
    {
      const std::lock_guard lock(rauc->mutex_);
      rauc->installed_ = path;
    }
    sd_bus_reply_method_return(message, "");
    rauc->operation_ = "installing";
    rauc->percent_ = rauc->first_percent;
    rauc->text_ = rauc->first_step;
    sd_bus_emit_properties_changed(rauc->bus_, "/", "de.pengutronix.rauc.Installer", "Operation",
                                   "Progress", nullptr);
    return 1;
  }
  void Report(int percent, const char* step) {
    percent_ = percent;
    text_ = step;
    sd_bus_emit_properties_changed(bus_, "/", "de.pengutronix.rauc.Installer", "Progress", nullptr);
  }
  void Finish() {
    percent_ = 100;
    text_ = fails ? "Installing failed." : "Installing done.";
    last_error_ = fails ? "Failed writing to the slot" : "";
    operation_ = "idle";
    sd_bus_emit_properties_changed(bus_, "/", "de.pengutronix.rauc.Installer", "Progress",
                                   "LastError", "Operation", nullptr);
    sd_bus_emit_signal(bus_, "/", "de.pengutronix.rauc.Installer", "Completed", "i", fails ? 1 : 0);
  }
  static int Progress(sd_bus*, const char*, const char*, const char*, sd_bus_message* reply,
                      void* self, sd_bus_error*) {
    const auto* rauc = static_cast<FakeRauc*>(self);
    return sd_bus_message_append(reply, "(isi)", rauc->percent_, rauc->text_, 1);
  }
  static int Text(sd_bus*, const char*, const char*, const char* name, sd_bus_message* reply,
                  void* self, sd_bus_error*) {
    const auto* rauc = static_cast<FakeRauc*>(self);
    const std::string property = name;
    return sd_bus_message_append(reply, "s",
                                 property == "Operation"   ? rauc->operation_
                                 : property == "LastError" ? rauc->last_error_
                                 : property == "BootSlot"  ? rauc->slot.c_str()
                                                           : "plumb-amd64");
  }

  static inline const sd_bus_vtable kTable[] = {
      SD_BUS_VTABLE_START(0),
      SD_BUS_METHOD("Info", "s", "ss", &FakeRauc::Info, SD_BUS_VTABLE_UNPRIVILEGED),
      SD_BUS_METHOD("InstallBundle", "sa{sv}", "", &FakeRauc::Install, SD_BUS_VTABLE_UNPRIVILEGED),
      SD_BUS_PROPERTY("Operation", "s", &FakeRauc::Text, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
      SD_BUS_PROPERTY("LastError", "s", &FakeRauc::Text, 0, SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
      SD_BUS_PROPERTY("Progress", "(isi)", &FakeRauc::Progress, 0,
                      SD_BUS_VTABLE_PROPERTY_EMITS_CHANGE),
      SD_BUS_PROPERTY("Compatible", "s", &FakeRauc::Text, 0, 0),
      SD_BUS_PROPERTY("BootSlot", "s", &FakeRauc::Text, 0, 0),
      SD_BUS_SIGNAL("Completed", "i", 0),
      SD_BUS_VTABLE_END};

  sd_bus* bus_ = nullptr;
  const char *operation_ = "idle", *last_error_ = "", *text_ = "";
  int percent_ = 0;
  std::atomic<bool> release_{false};
  std::atomic<int> reach_{-1};
  mutable std::mutex mutex_;
  std::string installed_;
  std::jthread thread_;
};

class UpdaterTest : public ::testing::Test {
 protected:
  UpdaterTest() {
    fs::create_directories(folder_ / "updates");
    WriteBundle("plumb-9.0.raucb");
  }

  /// As RAUC's plain and verity bundles are laid out: a squashfs, a signature, its size in eight
  /// bytes.
  void WriteBundle(const std::string& name, const std::string& magic = "hsqs",
                   unsigned char signature_size = 0xFF, std::size_t bytes = 8192) {
    std::string text = magic + std::string(bytes, 'x') + std::string(7, '\0');
    text += static_cast<char>(signature_size);
    std::ofstream(folder_ / "updates" / name, std::ios::binary) << text;
  }

  /// Runs the test beside the loop, which has the main thread; a loop that has ended does not begin
  /// again.
  void Play(const std::function<void()>& test) {
    std::jthread player([&] {
      test();
      On([this] { updater_.reset(); });
      loop_.Quit(0);
    });
    loop_.Run();
  }

  /// On the loop's thread; waits for it.
  void On(const std::function<void()>& work) {
    std::promise<void> done;
    loop_.Post("test", [&] {
      work();
      done.set_value();
    });
    done.get_future().wait();
  }

  void Start() {
    On([this] {
      updater_ = std::make_unique<Updater>(
          loop_,
          UpdaterOptions{
              .folder = folder_ / "updates",
              .max_bytes = 1 << 20,
              .bus_address = bus_.address(),
              .version = "0.1.0",
              .boot = boot_,
              .blocking_reason = [this] { return blocking_reason_; },
              .changed = [this] { ++num_changes_; },
              .run_in_background = {},
              .ended = [this](const std::string& bundle,
                              const std::string& failure) { ended_ = bundle + ": " + failure; },
              .rolled_back = [this](const std::string& text) { roll_backs_ += text; },
              .look_every = std::chrono::milliseconds(1),
              .now =
                  [this] {
                    ++num_looks_;
                    return EventLoop::Clock::time_point() + passed_.load();
                  }});
    });
  }

  [[nodiscard]] web::UpdateStatus StatusNow() {
    web::UpdateStatus status;
    On([&] { status = updater_->status(); });
    return status;
  }
  [[nodiscard]] std::string Ended() {
    std::string ended;
    On([&] { ended = ended_; });
    return ended;
  }

  /// False if it does not come to that within half a minute.
  [[nodiscard]] static bool Becomes(const std::function<bool()>& holds) {
    const auto until = EventLoop::Clock::now() + std::chrono::seconds(30);
    while (!holds()) {
      if (EventLoop::Clock::now() > until) return false;
      ::usleep(2000);
    }
    return true;
  }
  void WaitForRauc() {
    ASSERT_TRUE(Becomes([&] { return StatusNow().supported; }));
  }

  web::Change Install(const std::string& name) {
    auto answer = std::make_shared<std::promise<web::Change>>();
    On([&] {
      updater_->Install(name, [answer](const web::Change& change) { answer->set_value(change); });
    });
    auto future = answer->get_future();
    if (future.wait_for(std::chrono::seconds(30)) != std::future_status::ready) {
      ADD_FAILURE() << "no answer";
      return {};
    }
    return future.get();
  }

  EventLoop loop_;  // first: blocks signals before any thread starts
  TempFolder folder_;
  PrivateBus bus_{folder_.path()};
  std::unique_ptr<Updater> updater_;
  int num_changes_ = 0;
  std::string blocking_reason_;
  std::string ended_, roll_backs_;
  std::string boot_ = "first";
  std::atomic<std::chrono::seconds> passed_{std::chrono::seconds(0)};
  std::atomic<int> num_looks_ = 0;
};

TEST_F(UpdaterTest, WithoutABusItSaysThatThereIsNoInstaller) {
  Play([&] {
    bus_.Stop();
    Start();
    EXPECT_FALSE(StatusNow().supported);
    EXPECT_THAT(StatusNow().message, HasSubstr("no installer (RAUC) on this machine"));
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kConflict);
  });
}

TEST_F(UpdaterTest, ABusWithoutRaucIsTheSame) {
  Play([&] {
    Start();
    ::usleep(200000);  // for an answer that does not come: the status must hold
    EXPECT_FALSE(StatusNow().supported);
    EXPECT_THAT(Install("plumb-9.0.raucb").message, HasSubstr("on this machine"));
  });
}

TEST_F(UpdaterTest, AGoodBundleIsInstalledWithProgress) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    EXPECT_EQ(StatusNow().slot, "A");
    EXPECT_THAT(StatusNow().bundles, ::testing::ElementsAre("plumb-9.0.raucb"));
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    EXPECT_EQ(rauc.installed(), (folder_ / "updates" / "plumb-9.0.raucb").string());
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 0.4; }));
    EXPECT_TRUE(StatusNow().installing);
    EXPECT_EQ(StatusNow().message, "Copying image to rootfs.1");
    EXPECT_THAT(Install("plumb-9.0.raucb").message, HasSubstr("being installed"));
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_THAT(StatusNow().message, HasSubstr("restart the appliance"));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: ");
    EXPECT_GE(num_changes_, 4);
  });
}

/// One installs 9.0 from system A; the test then simulates a restart of the machine.
class RollBackTest : public UpdaterTest {
 protected:
  void InstallAndEnd() {
    Start();
    WaitForRauc();
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc_->Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_TRUE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().failure, "");
    On([&] { updater_.reset(); });
  }
  void StartAs(const std::string& boot) {
    boot_ = boot;
    Start();
    WaitForRauc();
  }
  std::unique_ptr<FakeRauc> rauc_ = std::make_unique<FakeRauc>(bus_.address());
};

TEST_F(RollBackTest, TheSameStartStillNeedsItsRestart) {
  Play([&] {
    InstallAndEnd();
    StartAs("first");
    EXPECT_TRUE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().rolled_back, "");
    EXPECT_EQ(roll_backs_, "");
  });
}

TEST_F(RollBackTest, AMachineThatStartsTheSystemBeforeSaysSoUntilSomebodyHasSeenIt) {
  Play([&] {
    InstallAndEnd();
    StartAs("second");
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_THAT(StatusNow().rolled_back, HasSubstr("version 9.0 was installed, but"));
    EXPECT_THAT(StatusNow().rolled_back, HasSubstr("0.1.0"));
    On([&] { EXPECT_EQ(roll_backs_, updater_->status().rolled_back) << "once"; });
    On([&] { updater_.reset(); });
    StartAs("third");
    EXPECT_NE(StatusNow().rolled_back, "") << "a second restart does not hide it";
    On([&] { updater_->ForgetRollBack(); });
    EXPECT_EQ(StatusNow().rolled_back, "");
    On([&] { updater_.reset(); });
    StartAs("fourth");
    EXPECT_EQ(StatusNow().rolled_back, "");
  });
}

TEST_F(RollBackTest, AMachineThatStartsTheNewSystemHasNothingToSay) {
  Play([&] {
    InstallAndEnd();
    rauc_->slot = "B";
    StartAs("second");
    EXPECT_EQ(StatusNow().slot, "B");
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(StatusNow().rolled_back, "");
    On([&] {
      updater_->ForgetRollBack();
      updater_.reset();
    });
    rauc_->slot = "A";  // the boot counter gave up on it later
    StartAs("third");
    EXPECT_NE(StatusNow().rolled_back, "");
  });
}

TEST_F(UpdaterTest, ABundleOfAStrangersKeyIsRefusedInRaucsWords) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    rauc.refuses_signature = true;
    Start();
    WaitForRauc();
    const web::Change answer = Install("plumb-9.0.raucb");
    EXPECT_EQ(answer.result, ChangeResult::kInvalid);
    EXPECT_THAT(answer.message, HasSubstr("signature verification failed"));
    EXPECT_EQ(StatusNow().failure, answer.message);
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(rauc.installed(), "");
    EXPECT_FALSE(StatusNow().installing);
  });
}

TEST_F(UpdaterTest, AnOlderVersionIsRefused) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    rauc.version = "0.0.9";
    Start();
    WaitForRauc();
    EXPECT_THAT(Install("plumb-9.0.raucb").message, HasSubstr("older than 0.1.0"));
    EXPECT_EQ(rauc.installed(), "");
  });
}

TEST_F(UpdaterTest, AScanThatBeganWhileTheBundleWasLookedAtGoesFirst) {
  blocking_reason_ = "a scan is running";
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    const web::Change answer = Install("plumb-9.0.raucb");
    EXPECT_EQ(answer.result, ChangeResult::kConflict);
    EXPECT_EQ(answer.message, blocking_reason_);
    EXPECT_EQ(rauc.installed(), "");
    EXPECT_FALSE(StatusNow().installing);
  });
}

TEST_F(UpdaterTest, AFailureInTheMiddleIsSaid) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    rauc.fails = true;
    Start();
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_THAT(StatusNow().message, HasSubstr("Failed writing to the slot"));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: Failed writing to the slot");
  });
}

TEST_F(UpdaterTest, ABusThatGoesAwayEndsTheInstallation) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    bus_.Stop();
    EXPECT_TRUE(Becomes([&] { return !Ended().empty(); }));
    EXPECT_THAT(Ended(), HasSubstr("broke"));
    EXPECT_FALSE(StatusNow().supported);
  });
}

TEST_F(UpdaterTest, AnInstallerThatDiesInTheMiddleEndsTheInstallation) {
  Play([&] {
    auto rauc = std::make_unique<FakeRauc>(bus_.address());
    Start();
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc.reset();
    ASSERT_TRUE(Becomes([&] { return !Ended().empty(); }));
    EXPECT_THAT(Ended(), HasSubstr("the installer ended before it was done"));
    EXPECT_FALSE(StatusNow().installing);
    EXPECT_THAT(StatusNow().message, HasSubstr("plumb-9.0.raucb was not installed"));
    rauc = std::make_unique<FakeRauc>(bus_.address());
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone) << "again, once it is back";
  });
}

/// The updater's clock is the test's.
class StandstillTest : public UpdaterTest {
 protected:
  void BeginAt(FakeRauc& rauc, const char* step, int percent) {
    rauc.first_step = step;
    rauc.first_percent = percent;
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    EXPECT_TRUE(Becomes([&] { return StatusNow().message == step; }));
  }
  /// Whether it goes on although that much time has passed and been looked at.
  bool GoesOnAt(std::chrono::seconds passed) {
    passed_ = passed;
    const int before = num_looks_;
    EXPECT_TRUE(Becomes([&] { return num_looks_ >= before + 3; }));
    return StatusNow().installing;
  }
  bool EndsAt(std::chrono::seconds passed) {
    passed_ = passed;
    return Becomes([&] { return !StatusNow().installing; });
  }
};

TEST_F(StandstillTest, AStepThatDoesNotEndIsAFailureAndAnotherAttemptCanBeMade) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    BeginAt(rauc, "Determining slot states", 0);
    EXPECT_TRUE(GoesOnAt(kLongestOtherStep - std::chrono::seconds(1)));
    EXPECT_TRUE(EndsAt(kLongestOtherStep));
    EXPECT_THAT(StatusNow().message,
                HasSubstr("no progress for 5 minutes, at 0 % of 'Determining"));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: " + StatusNow().failure);
    EXPECT_FALSE(StatusNow().restart_needed);
    BeginAt(rauc, "Copying image to rootfs.1", 40);
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return StatusNow().restart_needed; }));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: ");
  });
}

TEST_F(StandstillTest, ACopyHasLongerAndProgressBeginsTheTimeAnew) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    BeginAt(rauc, "Copying image to rootfs.1", 40);
    const std::chrono::seconds first = kLongestCopy - std::chrono::seconds(1);
    EXPECT_TRUE(GoesOnAt(first));
    rauc.Reach(60);
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 0.6; }));
    EXPECT_TRUE(GoesOnAt(first + first));
    EXPECT_TRUE(EndsAt(first + kLongestCopy));
    EXPECT_THAT(StatusNow().failure, HasSubstr("no progress for 30 minutes, at 60 % of 'Copying"));
  });
}

TEST_F(StandstillTest, CheckingTheBundleIsNoProgressOfItsInstallation) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    BeginAt(rauc, "Checking bundle done.", 100);
    EXPECT_EQ(StatusNow().fraction, 0.0);
    rauc.Reach(20);
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 0.2; }));
    rauc.Reach(100);
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 1.0; }));
    EXPECT_TRUE(StatusNow().installing) << "RAUC has not reported its end";
  });
}

TEST_F(StandstillTest, AnInstallationThatEndsAfterItWasGivenUpIsStillTold) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    BeginAt(rauc, "Copying image to rootfs.1", 40);
    EXPECT_TRUE(EndsAt(kLongestCopy));
    EXPECT_FALSE(StatusNow().restart_needed);
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return StatusNow().restart_needed; }))
        << "the next start is one of the new system";
    EXPECT_EQ(StatusNow().failure, "");
  });
}

TEST_F(UpdaterTest, OnlyBundlesOfTheFolderAreKnown) {
  Play([&] {
    FakeRauc rauc(bus_.address());
    WriteBundle(".hidden.raucb");
    WriteBundle("notes.txt");
    Start();
    WaitForRauc();
    for (const char* name : {"nothing.raucb", "../bus.conf", ".hidden.raucb", "notes.txt", ""}) {
      EXPECT_EQ(Install(name).result, ChangeResult::kNotFound) << name;
    }
  });
}

TEST_F(UpdaterTest, SentFilesBecomeBundlesOrAreRefused) {
  WriteBundle(".upload-left");
  Play([&] {
    FakeRauc rauc(bus_.address());
    Start();
    WaitForRauc();
    EXPECT_FALSE(fs::exists(folder_ / "updates" / ".upload-left")) << "of a run before";
    const auto add = [&](const std::string& from, const std::string& name) {
      web::Change change;
      On([&] { change = updater_->Add(folder_ / "updates" / from, name); });
      return change;
    };
    WriteBundle(".upload-1");
    EXPECT_EQ(add(".upload-1", "b.raucb").result, ChangeResult::kDone);
    EXPECT_THAT(StatusNow().bundles, ::testing::ElementsAre("b.raucb", "plumb-9.0.raucb"));
    WriteBundle(".upload-2", "GIF8");
    const web::Change picture = add(".upload-2", "picture.raucb");
    EXPECT_EQ(picture.result, ChangeResult::kInvalid);
    EXPECT_EQ(picture.message, "picture.raucb is not a bundle: expected a squashfs image");
    for (const char* name : {"c.raucb", "d.raucb", "e.raucb"}) {
      WriteBundle(".upload-3");
      EXPECT_EQ(add(".upload-3", name).result,
                std::string(name) == "e.raucb" ? ChangeResult::kConflict : ChangeResult::kDone)
          << name;
    }
    On([&] {
      EXPECT_EQ(updater_->Remove("c.raucb").result, ChangeResult::kDone);
      EXPECT_EQ(updater_->Remove("c.raucb").result, ChangeResult::kNotFound);
    });
    EXPECT_EQ(StatusNow().bundles.size(), 3U);
  });
}

TEST_F(UpdaterTest, WhatIsNoBundleIsRefusedBeforeRaucIsAsked) {
  const auto why = [&](const std::string& name) {
    return WhyNoBundle(folder_ / "updates" / name, 1 << 20);
  };
  EXPECT_EQ(why("plumb-9.0.raucb"), "");
  WriteBundle("zip.raucb", "PK\x03\x04");
  EXPECT_THAT(why("zip.raucb"), HasSubstr("expected a squashfs"));
  WriteBundle("cut.raucb", "hsqs", 0);
  EXPECT_THAT(why("cut.raucb"), HasSubstr("no signature at its end"));
  WriteBundle("large.raucb", "hsqs", 0xFF, 2 << 20);
  EXPECT_THAT(why("large.raucb"), HasSubstr("too large: 2 MB, at most 1 MB"));
  WriteBundle("short.raucb", "hsqs", 0xFF, 10);
  EXPECT_THAT(why("short.raucb"), HasSubstr("too short"));
  fs::create_directory(folder_ / "updates" / "folder.raucb");
  EXPECT_THAT(why("folder.raucb"), HasSubstr("not a regular file"));
  fs::create_symlink("/etc/passwd", folder_ / "updates" / "link.raucb");
  EXPECT_THAT(why("link.raucb"), HasSubstr("cannot be read"));
}

}  // namespace
}  // namespace plumb
